"""Candidates per tag, costs, ladder search, key tags and smoothing, motions in between."""

from postproc.planning.checks import (
    CLOSE,
    NEAR,
    Grade,
    grade_counts,
    near_solids,
    tag_clearances,
)
from postproc.planning.maps import (
    INDICES,
    FailingPose,
    PlanMaps,
    SpinClass,
    SpinCurves,
    SpinIndex,
    SpinMap,
    TagPose,
    TagPoses,
    colliding_pose,
    plan_maps,
    replanned,
    spin_curves,
    spin_degrees,
    spin_map,
)
from postproc.planning.places import Rank, Reach
from postproc.planning.planner import plan
from postproc.planning.repairs import repairs_tried
from postproc.planning.route import cell_at
from postproc.planning.search import arc_length
from postproc.planning.states import (
    HELD,
    OBJECTIVES,
    Objective,
    PlanOptions,
    StateContext,
    frames_across,
    has_pose,
    settle,
    stand_ins,
)
from postproc.planning.stretches import free_posture
