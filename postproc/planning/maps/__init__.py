"""What every spin about the tool axis would mean at every tag, for pages and tables."""

from postproc.planning.maps.plan_maps import (
    FailingPose,
    PlanMaps,
    SpinIndex,
    colliding_pose,
    plan_maps,
)
from postproc.planning.maps.spin_curves import INDICES, SpinCurves, spin_curves, spin_degrees
from postproc.planning.maps.spin_map import SpinClass, SpinMap, spin_map
from postproc.planning.maps.tag_poses import TagPose, TagPoses, replanned
