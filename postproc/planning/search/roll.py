"""The roll of the tool: one spin within a stroke, and a main spin for cuts that roll it far.

A stroke keeps the spin of the end from which a cut goes on: that one was searched with the cut.
Where rapids lead to it and away from it, the spin that costs least over the whole stroke and on the
ways to it and from it is taken: one that suits its top may stand at a limit at its bottom. A task
has given the orientation of its targets, so a stroke of it keeps that of its start.

The travel of a cut is priced by its square over the way, as it must be where a cut has to turn the
tool: the longer the way, the less. On a cut of many metres half a turn there and back is all but
free, and rounding of the grid of spins pays for it. So a cut that was found to roll the tool by
more than a quarter turn is searched once more: what stands off its main spin has to earn that.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, runs
from postproc.errors import Finding, Severity, listed
from postproc.geometry import twist_about
from postproc.kinematics import wrapped
from postproc.ladder import NONE
from postproc.model import CUTS, MotionKind
from postproc.planning.checks import Checker, Lines, Reason, failure
from postproc.planning.search.constants import MAIN_STEP, OWN_SPINS, PRICED, STEADY_BAND
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.search.rungs import price_of_lack, shares
from postproc.planning.states import BRANCHES, Chosen, Placement, evaluate, strokes_into
from postproc.units import DEG, TURN

_SAME = 1e-7
"""Spins nearer than this [rad] are one."""


def without_roll(search: PoseSearch, chosen: Chosen, best: FloatArray) -> list[Finding]:
    """Give the tags of every stroke one spin that serves them all.

    Args:
        search: what the poses were chosen by.
        chosen: taken over where another spin can be run.
        best: (n,) [N/m] the index that losses are priced against, NaN where unknown.

    Returns:
        An error for each stroke of a task that no single spin serves, one note for those of other
        files.
    """
    checker = search.checker
    toolpath = checker.problem.toolpath
    findings, rolling = [], []
    for tags in _strokes(checker, chosen):
        low = int(tags[1])
        offset = _offsets(checker, tags)
        spins = chosen.attitude[tags, 0] - offset
        roll = float(np.abs(spins - spins[0]).max())
        if roll < _SAME:
            continue
        ways = _ways(search, chosen, tags, offset, best)
        if any(_turned(checker, chosen, tags, offset + s, *way) for s, *way in ways):
            continue
        if not _is_left(chosen, tags):
            rolling.append((roll, low))
        if toolpath.format == "delmia":
            text = "no single turn about the tool axis serves this straight stroke"
            findings.append(failure(checker.problem, low, Reason.COLLISION, text))
    return findings or _noted(checker, rolling)


def _strokes(checker: Checker, chosen: Chosen) -> Iterator[IndexArray]:
    """Yield the tags of every stroke, its start included.

    Where the tool leaves a cut and comes back to the next one on the same line, it may turn between
    two rapids, out of the part: there are two strokes then.
    """
    toolpath = checker.problem.toolpath
    is_stroke = strokes_into(toolpath) & chosen.good & ~chosen.entry
    is_stroke &= np.append(False, chosen.good[:-1])
    rapid = np.asarray(toolpath.kind) == MotionKind.RAPID
    for low, high in runs(is_stroke.astype(np.int64)):
        if not is_stroke[low]:
            continue
        tags = np.arange(low - 1, high)
        between = np.flatnonzero(rapid[tags[:-1]] & rapid[tags[1:]]) + 1
        bound = not (_may_turn(checker, chosen, low - 1) or _ends(checker, chosen, high - 1))
        pieces = np.split(tags, between[:1]) if bound else [tags]
        yield from (piece for piece in pieces if len(piece) > 1)


def _is_left(chosen: Chosen, tags: IndexArray) -> bool:
    """Return whether the arm leaves a stroke on its way, out of the part, for another posture."""
    leap = np.abs(np.diff(chosen.q[tags], axis=0)).max() > np.pi
    return bool(leap or np.ptp(chosen.branch[tags]))


def _noted(checker: Checker, rolling: list[tuple[float, int]]) -> list[Finding]:
    if not rolling:
        return []
    toolpath, first = checker.problem.toolpath, rolling[0][1]
    lines = toolpath.line[[tag for _, tag in rolling]].tolist()
    most = max(roll for roll, _ in rolling) / DEG
    text = (
        f"the tool rolls by up to {most:{'.0f' if most > 10.0 else '.2g'}} deg while it goes "
        f"straight along its axis: lines {listed(lines)}"
    )
    hint = "cuts go on from both ends of the stroke, or no single turn was found for all of it"
    source = toolpath.source(first)
    return [Finding(Severity.NOTE, "PLN308", text, first, source, hint=hint)]


def _ways(
    search: PoseSearch, chosen: Chosen, tags: IndexArray, offset: FloatArray, best: FloatArray
) -> Iterator[tuple[float, int, int]]:
    """Yield the spins [rad] worth a try, the branch, and the place of the tag that stays.

    Where all tags may turn: those of the branches of the ends first, by what they cost.
    """
    checker, last = search.checker, len(tags) - 1
    spins = chosen.attitude[tags, 0] - offset
    ends = [0] * (not _may_turn(checker, chosen, int(tags[0])))
    ends += [last] * (not _ends(checker, chosen, int(tags[-1])))
    held = ends + np.flatnonzero(_is_pinned(checker, tags)).tolist()
    if held:
        if len(ends) < 2 and np.ptp(spins[held]) < _SAME:
            yield float(spins[held[0]]), int(chosen.branch[tags[held[0]]]), held[0]
        return
    some = _evenly(len(tags), OWN_SPINS)
    grid = checker.problem.settings.spins
    tried = np.concatenate([spins[some], grid[np.argsort(np.abs(grid - spins[0]), kind="stable")]])
    branches = [*dict.fromkeys(chosen.branch[tags[[0, last]]].tolist())]
    at = _evenly(len(tags), PRICED)
    price = np.array(
        [_price(search, chosen, tags[at], offset[at], tried, slot, best) for slot in branches]
    )
    order = np.argsort(price, axis=None, kind="stable")
    for slot, spin in zip(*np.unravel_index(order, price.shape), strict=True):
        if price[slot, spin] < np.inf:
            yield float(tried[spin]), branches[slot], -1
    others = (branch for branch in range(BRANCHES) if branch not in branches)
    yield from ((spin, branch, -1) for branch in others for spin in tried[len(some) :].tolist())


def _evenly(count: int, most: int) -> IndexArray:
    """Return up to ``most`` numbers below ``count``, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64))


def _price(
    search: PoseSearch,
    chosen: Chosen,
    tags: IndexArray,
    offset: FloatArray,
    spins: FloatArray,
    branch: int,
    best: FloatArray,
) -> FloatArray:
    """Return what a stroke costs at each of spins (s,), infinite where it is out of reach.

    As the search has it: what the poses of its key tags cost, and the ways along it, from the key
    tag before it and to the one behind.
    """
    problem, m, s = search.checker.problem, len(tags), len(spins)
    rows = np.repeat(tags, s)
    attitude = np.repeat(chosen.attitude[tags], s, axis=0)
    attitude[:, 0] = (offset[:, None] + spins).ravel()
    T, branches = problem.placement.tcp(rows, attitude), np.full(m * s, branch)
    q, good = problem.solve(T, problem.placement.external[rows], branches, chosen.q[rows[:1]])
    way = np.unwrap(q.reshape(m, s, 6), axis=0)
    q = way.reshape(-1, 6)
    good &= problem.within(q) & problem.regular(q)
    can_be_run = good.reshape(m, s).all(axis=0)
    keys = np.flatnonzero(np.isin(tags, search.tags))
    if not len(keys):
        return np.where(can_be_run, 0.0, np.inf)
    cost, index = evaluate(problem, rows, attitude[:, 0], T, q)
    cost += problem.settings.weights.price(1.0 - index / best[rows])
    if search.options.least is not None:
        cost += price_of_lack(index, search.options.least[rows])
    at = np.searchsorted(search.tags, tags[keys])
    price = shares(search.between, search.tags)[at] @ cost.reshape(m, s)[keys]
    rungs = np.concatenate([at[:1] - 1, at, at[-1:] + 1])
    rungs = rungs[(rungs >= 0) & (rungs < len(search.tags))]
    stand = search.tags[rungs]
    stops = np.repeat(chosen.q[stand][:, None], s, axis=1)
    stops[np.isin(rungs, at)] = way[keys]
    linked = chosen.good[stand[1:]] & chosen.good[stand[:-1]] & ~chosen.entry[stand[1:]]
    steps = search.ladder.weight[rungs[1:], None] * (np.diff(stops, axis=0) ** 2).sum(axis=2)
    price += steps[linked].sum(axis=0)
    return np.where(can_be_run, price, np.inf)


def _may_turn(checker: Checker, chosen: Chosen, tag: int) -> bool:
    """Return whether the start of a stroke may turn: nothing but a joint motion leads there."""
    toolpath = checker.problem.toolpath
    given = toolpath.joints is not None and bool(np.isfinite(toolpath.joints[tag]).all())
    joint = toolpath.kind[tag] in (MotionKind.JOINT, MotionKind.RAPID)
    return (joint or bool(chosen.entry[tag])) and not given and not bool(_is_pinned(checker, tag))


def _ends(checker: Checker, chosen: Chosen, tag: int) -> bool:
    """Return whether the end of a stroke may turn: no cut goes on from there."""
    toolpath, behind = checker.problem.toolpath, tag + 1
    if toolpath.format == "delmia":
        return True
    if behind < len(toolpath) and not chosen.entry[behind] and toolpath.kind[behind] in CUTS:
        return False
    return not bool(_is_pinned(checker, tag))


def _is_pinned(checker: Checker, tag: IndexArray | int) -> BoolArray:
    return np.asarray(~np.isnan(checker.problem.pins[tag]))


def _offsets(checker: Checker, tags: IndexArray) -> FloatArray:
    """Return the spin (m,) [rad] that each tag needs to stand as the first one at spin 0."""
    place = checker.problem.placement
    R = place.R_base_tcp[tags]
    return twist_about(np.swapaxes(R, 1, 2) @ R[0], place.tool_axis)


def _turned(
    checker: Checker, chosen: Chosen, tags: IndexArray, spins: FloatArray, slot: int, stays: int
) -> bool:
    """Turn a stroke to spins (m,); return whether that can be run, else nothing is changed."""
    problem, m = checker.problem, len(tags)
    attitude = chosen.attitude[tags].copy()
    kept = attitude[stays].copy()
    attitude[:, 0] = spins
    near = max(stays, 0)
    if stays >= 0:
        attitude[stays] = kept
    T, external = problem.placement.tcp(tags, attitude), problem.placement.external[tags]
    q, reached = problem.solve(T, external, np.full(m, slot), chosen.q[tags[[near] * m]])
    if stays >= 0:
        q[stays], reached[stays] = chosen.q[tags[stays]], True
    if not reached.all():
        return False
    q = np.vstack([np.unwrap(q[near::-1], axis=0)[:0:-1], np.unwrap(q[near:], axis=0)])
    if not (problem.within(q) & problem.regular(q)).all():
        return False
    contact, branch = np.ones(m - 1, dtype=np.bool_), np.full(m, slot)
    lines = Lines(T[:-1], T[1:], q[:-1], q[1:], branch[1:], contact, (external[:-1], external[1:]))
    if not checker.lines(lines)[0].good.all():
        return False
    chosen.attitude[tags], chosen.q[tags], chosen.branch[tags] = attitude, q, branch
    return True


def main_spins(search: PoseSearch) -> FloatArray | None:
    """Return the main spin (N,) [rad] of the tags of cuts that stand as one that rolls the tool.

    Cuts between which the tool does not turn in the air stand together: where one of them rolls it,
    that may be for the sake of the others. NaN at all other tags. A cut that has a main spin
    already keeps it. None where nothing is new, and where every tag is to stand at its best.

    Args:
        search: over key tags (n,).
    """
    if search.options.each:
        return None
    place, is_cut = search.checker.problem.placement, search.between.is_cut
    known, is_new = search.options.main, False
    main = np.full(len(place), np.nan) if known is None else known.copy()
    of_cut = is_cut | np.append(is_cut[1:], False)
    rows = np.flatnonzero((search.found.path != NONE) & of_cut[search.tags])
    if not len(rows):
        return None
    tags, spin = search.tags[rows], search.states.spin_of(search.found.path[rows])
    share = shares(search.between, search.tags)[rows]
    chain = np.cumsum(~is_cut)
    turns = np.abs(_turns(place, tags, spin)) > 2.0 * STEADY_BAND
    turns &= np.diff(chain[tags]) != 0
    bounds = np.flatnonzero(np.concatenate([[True], turns, [True]]))
    for low, high in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        own = tags[low:high]
        if np.isfinite(main[own]).any():
            continue
        onto = _central(place, own)
        roll = spin[low:high] - _level_spins(place, own, onto)
        cuts = np.split(roll, np.flatnonzero(np.diff(chain[own])) + 1)
        if max(_range(cut) for cut in cuts) <= 2.0 * STEADY_BAND:
            continue
        whole = np.arange(chain.searchsorted(chain[own[0]]), 1 + own[-1])
        whole = whole[of_cut[whole]]
        main[whole] = _level_spins(place, whole, onto) + _middle(roll, share[low:high])
        is_new = True
    return main if is_new else None


def _turns(place: Placement, tags: IndexArray, spin: FloatArray) -> FloatArray:
    """Return by how much (m-1,) [rad] the tool rolls from tag to tag (m,), its lean taken off."""
    R = _rotations(place, tags)
    own = twist_about(np.swapaxes(R[:-1], 1, 2) @ R[1:], place.tool_axis)
    return wrapped(own + np.diff(spin))


def _central(place: Placement, tags: IndexArray) -> int:
    """Return that of tags (m,) at which the tool leans least off its mean axis, robroot."""
    axis = _rotations(place, tags) @ place.tool_axis
    return int(tags[np.argmax(axis @ axis.mean(axis=0))])


def _level_spins(place: Placement, tags: IndexArray, onto: int) -> FloatArray:
    """Return the spins (m,) [rad] at which the tool stands as at spin 0 of a tag, but for its lean.

    As the arm sees it: a table may turn the work.
    """
    R_robroot_onto = _rotations(place, np.array([onto]))[0]
    R_tag_onto = np.swapaxes(_rotations(place, tags), 1, 2) @ R_robroot_onto
    return twist_about(R_tag_onto, place.tool_axis)


def _rotations(place: Placement, tags: IndexArray) -> FloatArray:
    """Return R_robroot_tcp (m, 3, 3) of tags (m,) at spin 0."""
    R_robroot_base = place.base(place.external[tags])[..., :3, :3]
    return np.asarray(R_robroot_base @ place.R_base_tcp[tags])


def _range(roll: FloatArray) -> float:
    """Return the smallest range [rad] that holds all of some angles (m,)."""
    around = np.sort(np.mod(roll, TURN))
    return TURN - float(np.diff(around, append=around[0] + TURN).max())


def _middle(roll: FloatArray, weight: FloatArray) -> float:
    """Return the angle [rad] about which the most of angles (m,) lie within ``STEADY_BAND``.

    Those nearer to it count more: of two that hold as many the more central one is taken.
    """
    angles = np.arange(0.0, TURN, MAIN_STEP)
    off = np.abs(wrapped(roll - angles[:, None]))
    near = np.where(off <= STEADY_BAND, np.cos(off), 0.0)
    return float(angles[np.argmax(np.round(near @ weight, 9))])
