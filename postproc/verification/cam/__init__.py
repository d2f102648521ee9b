"""The executed path held against the CAM file: points, arcs, holes, feeds, profiles, events, tilt."""

from postproc.verification.cam.comparison import Comparison, Tolerances
from postproc.verification.cam.events import check_events
from postproc.verification.cam.order import compare_served
from postproc.verification.cam.profiles import check_profiles
from postproc.verification.cam.steps import check_steps

__all__ = [
    "Comparison",
    "Tolerances",
    "check_events",
    "check_profiles",
    "check_steps",
    "compare_served",
]
