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
    spin_curves,
    spin_degrees,
    spin_map,
)
from postproc.planning.places import Rank, Reach
from postproc.planning.planner import plan
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

__all__ = [
    "CLOSE",
    "HELD",
    "INDICES",
    "NEAR",
    "OBJECTIVES",
    "FailingPose",
    "Grade",
    "Objective",
    "PlanMaps",
    "PlanOptions",
    "Rank",
    "Reach",
    "SpinClass",
    "SpinCurves",
    "SpinIndex",
    "SpinMap",
    "StateContext",
    "TagPose",
    "TagPoses",
    "arc_length",
    "cell_at",
    "colliding_pose",
    "frames_across",
    "free_posture",
    "grade_counts",
    "has_pose",
    "near_solids",
    "plan",
    "plan_maps",
    "settle",
    "spin_curves",
    "spin_degrees",
    "spin_map",
    "stand_ins",
    "tag_clearances",
]
