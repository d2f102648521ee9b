"""The executed path held against the CAM file: points, arcs, holes, feeds, blends, events, tilt."""

from postproc.verification.cam.comparison import Comparison, Tolerances
from postproc.verification.cam.events import check_events
from postproc.verification.cam.leaving import leads_in
from postproc.verification.cam.order import compare_served, in_program_order
from postproc.verification.cam.profiles import check_profiles

__all__ = [
    "Comparison",
    "Tolerances",
    "check_events",
    "check_profiles",
    "compare_served",
    "in_program_order",
    "leads_in",
]
