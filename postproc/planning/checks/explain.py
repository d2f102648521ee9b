"""Findings about tags that cannot be run: what stands against them, and what would help.

The smallest change that would make a failing tag possible is looked for: more spin, or a tilt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.errors import Finding, Severity
from postproc.model import ToolPath
from postproc.planning.checks.feasible import Checker, Reason
from postproc.planning.states import (
    BRANCHES,
    NO_POSE,
    Chosen,
    Problem,
    States,
    feed_directions,
    postures,
    spin_values,
)
from postproc.records import dataclass
from postproc.units import DEG

WORDS = {
    Reason.UNREACHABLE: "unreachable",
    Reason.JOINT_LIMIT: "joint limit",
    Reason.SINGULAR: "singular",
    Reason.COLLISION: "collision",
    Reason.SPEED: "speed",
}
_LEAVE = "let it be lifted off ([motion] retract_in_cuts), or "
LOWER = "let the feed be lowered more ([process] least_feed_percent)"
"""What frees a cut on which an axis cannot follow the lowest feed of the process."""
HELPED = 20
"""At so many failing tags a remedy is looked for."""
ALIKE = 50
"""So many tags at most that fail one after the other for the same reason share a remedy."""
COUNTED = (Reason.UNREACHABLE, Reason.JOINT_LIMIT, Reason.SINGULAR)
HURDLES = (Reason.COLLISION, Reason.SPEED, Reason.SINGULAR, Reason.JOINT_LIMIT, Reason.UNREACHABLE)
"""What stands in the way, the last that is checked first."""

TILTS = (2.0 * DEG, 5.0 * DEG, 10.0 * DEG, 15.0 * DEG, 30.0 * DEG)
LEAD_OUT = "let the CAM file lead the tool out, or lower [motion] approach_mm"
"""What helps where the tool cannot back off along its axis from the end of a cut."""
_STEP = 10.0 * DEG


def failure(problem: Problem, tag: int, reason: Reason, detail: str, hint: str = "") -> Finding:
    """Return the finding of a tag that fails."""
    name = problem.toolpath.tag_name(tag)
    return Finding(
        Severity.ERROR,
        f"PLN{int(reason)}",
        f"tag {name}: {WORDS[reason]}: {detail}",
        tag,
        problem.toolpath.source(tag),
        hint=hint,
    )


def no_pose(toolpath: ToolPath, tag: int) -> Finding:
    """Return the finding of a tag without a Cartesian target."""
    name, source = toolpath.tag_name(tag), toolpath.source(tag)
    return Finding(Severity.ERROR, "PLN206", f"tag {name}: {NO_POSE}", tag, source)


@dataclass(frozen=True, slots=True)
class Break:
    r"""What becomes of ``count`` poses at a tag, carried on to the next one, as the tool stands.

    ``reasons``: how many fail for each; ``pair``: what hits most often, -1 without; ``over`` [rad]:
    how far the least of them is over a joint limit, at ``axis`` (0 to 5); ``bent`` [rad]: the
    largest \|A5\| of those that come too near to a straight wrist.
    """

    count: int
    reasons: Mapping[Reason, int]
    pair: int
    over: float
    axis: int
    bent: float

    @property
    def main(self) -> Reason:
        """The last hurdle: poses that fail later passed all before."""
        return next(reason for reason in HURDLES if reason in self.reasons)


@dataclass(frozen=True, slots=True)
class Evidence:
    """Why states and steps failed, as a search saw it.

    ``reason``, ``pair`` (N,) of the states; ``breaks``: of the rungs into which no cut leads.
    """

    tags: IndexArray
    states: States
    reason: IndexArray
    pair: IndexArray
    breaks: Mapping[int, Break]
    chosen: Chosen


def gave_up(
    checker: Checker, chosen: Chosen, findings: list[Finding], tags: list[int]
) -> list[Finding]:
    """Return a finding for every tag without a pose that none of ``findings`` is about.

    ``tags``: where the search stopped before all was refuted.
    """
    problem = checker.problem
    said = {finding.tag_index for finding in findings}
    lost = {*np.flatnonzero(~chosen.good).tolist(), *tags} - said
    return [given_up(problem, tag) for tag in sorted(lost)]


def given_up(problem: Problem, tag: int, what: str = "no path was found here") -> Finding:
    """Return the finding of a tag at which the search stopped, ``what`` in words what it found."""
    return Finding(
        Severity.ERROR,
        "PLN106",
        f"tag {problem.toolpath.tag_name(tag)}: the search gave up: {what}, but not every one "
        "is ruled out",
        tag,
        problem.toolpath.source(tag),
        hint=f"lift the tool off before this tag, {_leave(problem)}split the cut",
    )


class _Remedies:
    """What would help failing tags: looked for once in a neighbourhood, and not too often.

    Each search tries hundreds of poses; thousands of tags that fail alike need no more than a few.
    """

    def __init__(self, checker: Checker) -> None:
        self._checker = checker
        self._searches = 0
        self._first, self._row = -1, -1
        self._reason, self._text = Reason.NONE, ""

    def hint(self, row: int, tag: int, reason: Reason) -> str:
        """Return what would help the tag of a row; ask for rows in growing order."""
        beside = row == self._row + 1 and reason is self._reason and row < self._first + ALIKE
        self._row = row
        if beside:
            return self._text
        self._first, self._reason, self._text = row, reason, ""
        if self._searches == HELPED:
            self._text = f"remedies were searched at {HELPED} earlier tags only"
            return self._text
        self._searches += 1
        found = remedy(self._checker, tag, reason)
        if found:
            self._text = f"at tag {self._checker.problem.toolpath.tag_name(tag)} nearby: {found}"
        return found


def explained(checker: Checker, evidence: Evidence) -> list[Finding]:
    """Return one finding for every tag that has no pose, or that no cut can enter."""
    lost = np.flatnonzero(~evidence.chosen.good).tolist()
    remedies = _Remedies(checker)
    findings = [_no_pose(checker, evidence, row, remedies) for row in lost]
    return findings + [_no_way(checker, evidence, row) for row in sorted(evidence.breaks)]


def _no_pose(checker: Checker, evidence: Evidence, row: int, remedies: _Remedies) -> Finding:
    tag = int(evidence.tags[row])
    if not checker.problem.placement.given[tag]:
        return no_pose(checker.problem.toolpath, tag)
    low, high = int(evidence.states.offsets[row]), int(evidence.states.offsets[row + 1])
    reasons = evidence.reason[low:high]
    first = np.flatnonzero(np.diff(evidence.states.config[low:high], prepend=-1))
    pin, same = pinned(checker.problem, tag), 1
    if pin:  # all columns hold the one spin; one of them was checked
        same = max(1, int(evidence.states.tried[row]) // BRANCHES)
        first = first[np.isfinite(evidence.states.cost[low:high][first])]
    counts = dict(zip(COUNTED, (evidence.states.refused[row] // same).tolist(), strict=True))
    for reason in COUNTED:
        counts[reason] = counts[reason] + int((reasons[first] == reason).sum())
    counts[Reason.COLLISION] = int((reasons[first] == Reason.COLLISION).sum())
    # The last hurdle is what stands in the way: poses that fail later passed all before.
    main = next((reason for reason in HURDLES if counts.get(reason)), Reason.UNREACHABLE)
    parts = [f"{counts[r]} {WORDS[r]}" for r in (*COUNTED, Reason.COLLISION) if counts[r]]
    tried = int(evidence.states.tried[row]) // same
    detail = f"{pin}none of {tried} poses can be run ({', '.join(parts)})"
    pairs = evidence.pair[low:high][reasons == Reason.COLLISION]
    if main is Reason.COLLISION and len(pairs):
        detail += f"; {_most_frequent(checker, pairs)}"
    return failure(checker.problem, tag, main, detail, remedies.hint(row, tag, main))


def pinned(problem: Problem, tag: int) -> str:
    """Return ``pinned to a spin of ... deg: `` for a pinned tag, else nothing."""
    spin = float(problem.pins[tag])
    return "" if np.isnan(spin) else f"pinned to a spin of {spin / DEG:g} deg: "


def _most_frequent(checker: Checker, pairs: IndexArray) -> str:
    numbers, counts = np.unique(pairs[pairs >= 0], return_counts=True)
    if not len(numbers):
        return "solids collide"
    return f"most often {checker.met(int(numbers[np.argmax(counts)]))}"


def _no_way(checker: Checker, evidence: Evidence, row: int) -> Finding:
    found, tag = evidence.breaks[row], int(evidence.tags[row])
    if not found.reasons:  # poses lead on between those of the grid
        return given_up(checker.problem, tag)
    before = checker.problem.toolpath.tag_name(int(evidence.tags[row - 1]))
    pin = pinned(checker.problem, tag)
    parts = [f"{count} {WORDS[reason]}" for reason, count in found.reasons.items()]
    free = found.count - sum(found.reasons.values())
    parts += [f"{free} reach a pose between the grid's"] if free else []
    detail = (
        f"{pin}no single arm configuration serves the cut from tag {before}: of {found.count} "
        f"poses that lead there as the tool stands {', '.join(parts)}"
    )
    if other := pinned(checker.problem, int(evidence.tags[row - 1])):
        detail += f"; tag {before} is {other.rstrip(': ')}"
    if 0 <= found.pair < len(checker.pairs):
        detail += f"; most often {checker.met(found.pair)}"
    nearest = _nearest(checker, found)
    hint = "" if pin else f"lift the tool off here, {_leave(checker.problem)}{nearest}"
    return failure(checker.problem, tag, found.main, detail, hint)


def _leave(problem: Problem) -> str:
    """Return the key that lets a cut be left, with what joins it to the next hint; empty if set."""
    return "or " if problem.cell.motion.retract_in_cuts else _LEAVE


def _nearest(checker: Checker, found: Break) -> str:
    """Return the nearest change that would let a pose lead on."""
    ways = []
    if Reason.JOINT_LIMIT in found.reasons and found.over > 0.0:
        ways.append(f"gain {np.ceil(10.0 * found.over / DEG) / 10.0:g} deg at A{found.axis + 1}")
    if Reason.SINGULAR in found.reasons and found.bent < checker.problem.cell.limits.singularity:
        ways.append(f"allow A5 at {np.floor(10.0 * found.bent / DEG) / 10.0:g} deg")
    if Reason.COLLISION in found.reasons:
        ways.append("clear what is hit")
    if Reason.SPEED in found.reasons:
        ways.append(LOWER)
    return ", ".join([*ways, "move or turn the workpiece"])


def remedy(checker: Checker, tag: int, reason: Reason) -> str:
    """Return what would help a tag, in words, empty if nothing tried does.

    Tried in turn: any spin at all, lead and side tilt where the tool mills; the smallest that gives
    a pose within reach and limits, free of collision, is named, stroke and way out of material and
    all. A hole is never tilted: it would be another hole. What frees all tags is asked of the whole
    job, not here.
    """
    spins = spin_values(_STEP, -np.pi, np.pi)
    standing, free = _free_spins(checker, tag, _upright(spins))
    if free.any():
        how = "widen range_deg" if np.isnan(checker.problem.pins[tag]) else "pin it there"
        return f"a spin of {_least(spins[free])} deg about the tool axis works: {how}"
    if standing.any() and checker.problem.ways_out[tag]:
        return (
            f"the tool is clear at a spin of {_least(spins[standing])} deg but cannot leave "
            f"the cut: {LEAD_OUT}"
        )
    if text := _lead_or_side(checker, tag):
        return text
    if reason is not Reason.COLLISION:
        return ""
    if not standing.any():
        return "no spin is free of collision here"
    where = f"the tool is clear at a spin of {_least(spins[standing])} deg"
    return f"{where} but not all along its stroke"


def _least(spins: FloatArray) -> str:
    """Return the smallest of spins (s,) [rad] in degrees."""
    return f"{spins[np.argmin(np.abs(spins))] / DEG:.0f}"


def _lead_or_side(checker: Checker, tag: int) -> str:
    """Return the smallest lead or side tilt that helps a milling tag, at its spins."""
    problem = checker.problem
    place, spins, allowed = problem.placement, problem.settings.spins, problem.cell.optimize.tilt
    feed = feed_directions(problem.toolpath, place.axis_base(np.arange(len(place))))
    if not np.isfinite(feed[tag]).all():
        return ""
    tilted = replace(checker, problem=replace(problem, placement=replace(place, feed=feed)))
    words = (("lead angle", "lead_deg", allowed.lead), ("side tilt", "side_tilt_deg", allowed.side))
    for size in TILTS:
        for column, (word, key, (low, high)) in enumerate(words, start=1):
            for tilt in (size, -size):
                attitude = _upright(spins)
                attitude[:, column] = tilt
                if _free_spins(tilted, tag, attitude)[1].any():
                    way = f"widen {key}" if not low <= tilt <= high else "lower tilt_step_deg"
                    return f"a {word} of {tilt / DEG:.0f} deg would do: {way} in [optimize]"
    return ""


def _upright(spins: FloatArray) -> FloatArray:
    """Return attitudes (s, 3) [rad] at spins (s,) without a tilt."""
    return np.stack([spins, np.zeros_like(spins), np.zeros_like(spins)], axis=1)


def _free_spins(checker: Checker, tag: int, attitude: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return at which of attitudes (s, 3) [rad] a tool stands free, and where it also comes away.

    Free of collision in some branch; coming away is the stroke, or the way out of material.
    """
    tags = np.full(len(attitude), tag)
    found = postures(checker.problem, tags, checker.problem.placement.tcp(tags, attitude))
    row, branch = np.nonzero(found.good)
    q = found.q[row, branch]
    standing, free = np.zeros((2, len(attitude)), dtype=np.bool_)
    away = checker.states(tags[row], q, attitude[row], branch).good
    if checker.problem.ways_out[tag]:
        away &= checker.problem.way_out(tags[row], attitude[row], branch, q)[2]
    standing[row[checker.poses(tags[row], q).good]] = True
    free[row[away]] = True
    return standing, free
