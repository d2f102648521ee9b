"""The executed path held against the CAM file: a ``Match`` of both, and the checks that judge it.

A check is a function of the run and the match that yields what it finds. None reads what another
found, so their order does not matter.
"""

from collections.abc import Callable, Iterator

from postproc.verification.cam.events import check_dwells, check_events, check_surplus
from postproc.verification.cam.feeds import check_approximation, check_feeds, check_joint_speeds
from postproc.verification.cam.holes import check_holes, check_strokes
from postproc.verification.cam.leaving import (
    check_leaving,
    check_relative,
    check_still,
    check_unasked,
    leads_in,
)
from postproc.verification.cam.match import Match, match_of
from postproc.verification.cam.points import check_again, check_missed, check_passed, check_points
from postproc.verification.cam.ways import check_turns, check_ways
from postproc.verification.report import Said
from postproc.verification.run import Run

CHECKS: tuple[Callable[[Run, Match], Iterator[Said]], ...] = (
    check_points,
    check_missed,
    check_passed,
    check_again,
    check_ways,
    check_turns,
    check_holes,
    check_strokes,
    check_feeds,
    check_leaving,
    check_unasked,
    check_relative,
    check_still,
    check_approximation,
    check_joint_speeds,
    check_events,
    check_surplus,
    check_dwells,
)
