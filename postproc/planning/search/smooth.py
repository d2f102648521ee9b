"""The smoothing of Jiao et al. 2022: key tags optimised, the spin of the others interpolated.

With ``refine`` off the key tags take the best spin of the grid each, as in the paper; with it they
are chosen together, travel counted, so that the way between two of them rarely crosses a trough.

The paper interpolates the first roll angle of the inverse rotation (Eqs. 28-37), which fails where
that angle wraps, where the tool is vertical, and by the signs printed. Here the spin is measured
against a cross direction that is carried along the path by the smallest rotation from tool axis to
tool axis (parallel transport), unwrapped, and interpolated over arc length: the same where the
paper's holds, free of singularities elsewhere. Where the cell allows a tilt of the tool axis, lead
and side tilt run linearly over arc length as well.

Interpolation can lose much of the stiffness that the key tags gained. The loss of every tag against
its own optimum is therefore measured, and key tags are added where it exceeds the bound, as well
as where an interpolated pose cannot be run. Key tags themselves only take poses within the bound,
unless no cut that can be run joins such poses.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.errors import Finding, Severity
from postproc.planning.checks import Checker, Reason, explained, failure
from postproc.planning.search.keytags import arc_length, key_tags, stretches
from postproc.planning.search.pose_search import (
    TIE_TRAVEL,
    PoseSearch,
    check_chain,
    step_rules,
    travel,
)
from postproc.planning.states import (
    NONE,
    TRAVEL_UNIT,
    Chosen,
    Placement,
    Problem,
    Rule,
    cross_axes,
    evaluate,
    rounded_spin,
    transported,
)

_FULL_TURN = 2.0 * np.pi
_ROUNDS = 60
_FEW = 8
"""After so many rounds every tag beyond the bound becomes a key tag, not only the worst ones."""
_FREE = 30
"""After so many rounds the bound no longer rules out poses of key tags."""
_WORTH = 0.98
_PATIENCE = 4
"""Then key tags for less loss are added until so many rounds in turn did not lower the excess over
the bound to the share ``_WORTH`` of the least so far."""
_ROUNDING = 1e-6


def smooth(
    checker: Checker, step: Callable[[int, int, str], None]
) -> tuple[Chosen, list[Finding], dict[str, object]]:
    """Return poses, findings and record of the strategy ``smooth``."""
    problem = checker.problem
    n = len(problem)
    keys = key_tags(problem.toolpath, problem.cell.optimize)
    first_keys = int(keys.sum())
    best, least, stale = _best_index(checker), np.inf, 0
    released = np.zeros(n, dtype=np.bool_)
    for round_ in range(_ROUNDS):
        step(int(keys.sum()), n, "smooth")
        tags = np.nonzero(keys)[0]
        released |= round_ >= _FREE
        search = _search_of_keys(checker, tags, np.where(released, np.nan, best))
        found = search.run()
        key = search.chosen(found)
        chosen, failing = _filled(checker, key, tags, last=round_ == _ROUNDS - 1)
        loss = _loss(problem, chosen, best)
        stuck = _stuck(search, key, failing, released)
        if stuck.any():
            released |= stuck
            continue
        excess = float(np.nansum(np.maximum(loss - problem.cell.optimize.loss_bound, 0.0)))
        stale = 0 if excess < _WORTH * least or round_ < _FREE else stale + 1
        least = min(excess, least)
        shown = loss if stale < _PATIENCE else np.zeros(n)
        added = _more_keys(problem, keys, failing, shown, every=round_ >= _FEW)
        if not added.any():
            break
        keys |= added
    record = {
        **search.record(found, key),
        "key_tags": tags.tolist(),
        "loss": np.where(chosen.good, loss, np.nan).tolist(),
        "travel_rad2": travel(chosen),
    }
    findings = [*explained(checker, search.evidence(key)), _report(problem, loss, tags)]
    findings += _given_up(problem, chosen, findings)
    if len(tags) > first_keys:
        record["key_tags_added"] = len(tags) - first_keys
    return chosen, findings, record


def _search_of_keys(checker: Checker, tags: IndexArray, best: FloatArray) -> PoseSearch:
    """Return the search over the key tags (k,).

    Key tags are chosen together, travel counted, and would pay any stiffness for it. So poses that
    lose more than the bound are ruled out.

    Args:
        checker: of the problem.
        tags: (k,).
        best: (n,) best index of each tag [N/m]; NaN: nothing is ruled out.
    """
    problem = checker.problem
    search = PoseSearch.of(checker, tags, each=not problem.cell.optimize.refine)
    if not problem.cell.optimize.refine:
        search.ladder.weight[:] = TIE_TRAVEL / TRAVEL_UNIT**2
    search.ladder.rule[1:] = np.where(_same_stretch(problem, tags), Rule.CHAIN, Rule.FREE)
    owner = search.states.tag_of(np.arange(len(search.states.q)))
    least = (1.0 - problem.cell.optimize.loss_bound - _ROUNDING) * best[tags]
    ruled_out = ~search.pinned[owner] & (search.states.index < least[owner])
    search.ladder.cost[ruled_out] = np.inf
    return search


def _stuck(search: PoseSearch, key: Chosen, failing: BoolArray, released: BoolArray) -> BoolArray:
    """Return (n,) key tags, not released yet, between which no cut can be run.

    Those on both sides of such a cut; where they were released before, the next ones beyond.
    """
    tags = search.tags
    result = np.zeros_like(released)
    adjacent = np.append(False, np.diff(tags) == 1)
    chain = search.ladder.rule == Rule.CHAIN
    bad = chain & (key.entry | ~key.good | (adjacent & failing[tags]))
    held = np.flatnonzero(~released[tags])
    for k in np.flatnonzero(bad[1:]) + 1:
        before, behind = held[held < k], held[held >= k]
        result[tags[np.append(before[-1:], behind[:1])]] = True
    return result


def interpolated_spin(
    placement: Placement, tags: IndexArray, way: FloatArray, spin: FloatArray, known: BoolArray
) -> FloatArray:
    """Return the spins (m,) of successive tags, interpolated between those known.

    Args:
        placement: of the tags.
        tags: (m,) in the order of the path.
        way: (m,) length of the path at each [m].
        spin: (m,) [rad], of meaning where ``known``.
        known: (m,), the first and the last among them.
    """
    axis = placement.axis_base(tags)
    first, _ = cross_axes(placement.tool_axis)
    cross = placement.R_base_tcp[tags] @ first
    carried = transported(axis, cross[0])
    sine = np.einsum("ij,ij->i", np.cross(carried, cross), axis)
    offset = np.arctan2(sine, np.einsum("ij,ij->i", carried, cross))
    at = np.nonzero(known)[0]
    twist = np.unwrap(spin[at] + offset[at])
    distance = way if way[-1] > way[0] else np.arange(len(way), dtype=np.float64)
    full = np.interp(distance, distance[at], twist) - offset
    full += _FULL_TURN * np.round((_line(spin, at, distance) - full) / _FULL_TURN)
    full[at] = spin[at]
    return rounded_spin(full)


def _line(spin: FloatArray, at: IndexArray, distance: FloatArray) -> FloatArray:
    return np.asarray(np.interp(distance, distance[at], spin[at]))


def _same_stretch(problem: Problem, tags: IndexArray) -> BoolArray:
    number = stretches(problem.toolpath)[tags]
    return np.asarray(np.diff(number) == 0)


def _filled(
    checker: Checker, key: Chosen, tags: IndexArray, *, last: bool
) -> tuple[Chosen, BoolArray]:
    """Return poses of all tags, and which of those between key tags cannot be run so.

    Args:
        checker: of the problem.
        key: poses of the key tags.
        tags: (k,) the key tags.
        last: tags that fail are given up, not marked for another try.
    """
    problem = checker.problem
    n = len(problem)
    attitude, q = np.zeros((n, 3)), np.zeros((n, 6))
    branch = np.zeros(n, dtype=np.int64)
    good = np.zeros(n, dtype=np.bool_)
    attitude[tags], q[tags], branch[tags], good[tags] = key.attitude, key.q, key.branch, key.good
    way = arc_length(problem.toolpath)
    failing = np.zeros(n, dtype=np.bool_)
    for k in range(1, len(tags)):
        a, b = int(tags[k - 1]), int(tags[k])
        if b == a + 1:
            continue
        inner = np.arange(a + 1, b)
        if not (key.good[k - 1] and key.good[k]) or key.entry[k]:
            failing[inner] = True
            continue
        span = np.arange(a, b + 1)
        known = np.isin(span, (a, b))
        spin = interpolated_spin(problem.placement, span, way[span], attitude[span, 0], known)
        branch[inner] = key.branch[k]
        share = (way[inner] - way[a]) / max(way[b] - way[a], 1e-12)
        tilt = attitude[a, 1:] + share[:, None] * (attitude[b, 1:] - attitude[a, 1:])
        tilt[~problem.placement.may_tilt[inner]] = 0.0
        attitude[inner] = np.column_stack([spin[1:-1], tilt])
        q[inner] = q[a] + share[:, None] * (q[b] - q[a])
        good[inner] = True
    inner = np.setdiff1d(np.nonzero(good)[0], tags)
    if len(inner):
        T = problem.placement.tcp(inner, attitude[inner])
        solved, reached = problem.solve(T, branch[inner], q[inner])
        q[inner] = np.where(reached[:, None], solved, q[inner])
        fine = reached & problem.within(q[inner]) & problem.regular(q[inner])
        rows = inner[fine]
        fine[fine] = checker.states(rows, q[rows], attitude[rows], branch[rows]).good
        failing[inner[~fine]] = True
    entry = np.zeros(n, dtype=np.bool_)
    entry[:1] = True
    entry[tags] = key.entry
    _check_cuts(checker, Chosen(attitude, branch, q, good & ~failing, entry), failing)
    good &= ~failing
    entry[1:] |= ~good[:-1]
    return Chosen(attitude, branch, q, good, entry), failing & (not last)


def _check_cuts(checker: Checker, chosen: Chosen, failing: BoolArray) -> None:
    """Mark the tags whose cut from the tag before cannot be run."""
    rule = step_rules(checker.problem)
    into = (rule == Rule.CHAIN) & chosen.good & ~chosen.entry
    into[1:] &= chosen.good[:-1]
    b = np.nonzero(into)[0]
    b = b[b > 0]
    if not len(b):
        return
    verdict = check_chain(
        checker,
        (b - 1, b),
        (chosen.attitude[b - 1], chosen.attitude[b]),
        (chosen.q[b - 1], chosen.q[b]),
        chosen.branch[b],
    )
    failing[b[~verdict.good]] = True


def _best_index(checker: Checker) -> FloatArray:
    """Return the best stiffness index (n,) [N/m] that each tag could have by itself."""
    problem = checker.problem
    best = np.full(len(problem), np.nan)
    if problem.settings.weights.main is None:
        return best
    search = PoseSearch.of(checker, np.arange(len(problem)), each=True)
    search.ladder.rule[:] = Rule.FREE
    path = search.run(steps=False).path
    good = path != NONE
    best[good] = search.states.index[path[good]]
    return best


def _loss(problem: Problem, chosen: Chosen, best: FloatArray) -> FloatArray:
    """Return the loss (n,) of the index against each tag's own optimum; below 0 for a gain."""
    loss = np.full(len(best), np.nan)
    tags = np.nonzero(chosen.good & np.isfinite(best))[0]
    if len(tags):
        T = problem.placement.tcp(tags, chosen.attitude[tags])
        index = evaluate(problem, tags, chosen.spin[tags], T, chosen.q[tags])[1]
        loss[tags] = 1.0 - index / best[tags]
    return loss


def _more_keys(
    problem: Problem, keys: BoolArray, failing: BoolArray, loss: FloatArray, *, every: bool
) -> BoolArray:
    """Return the tags to make key: between two key tags the middle failing or the worst one.

    ``every``: not only the worst one but all beyond the bound.
    """
    added = np.zeros_like(keys)
    lossy = np.nan_to_num(loss, nan=0.0) > problem.cell.optimize.loss_bound
    at = np.nonzero(keys)[0]
    for a, b in zip(at[:-1].tolist(), at[1:].tolist(), strict=True):
        bad = a + 1 + np.nonzero(failing[a + 1 : b])[0]
        if len(bad):
            added[bad[len(bad) // 2]] = True
        elif every:
            added[a + 1 : b] |= lossy[a + 1 : b]
        elif lossy[a + 1 : b].any():
            added[a + 1 + int(np.nanargmax(loss[a + 1 : b]))] = True
        elif failing[b] and b > a + 1:
            added[(a + b) // 2] = True
    return added & ~keys


def _given_up(problem: Problem, chosen: Chosen, findings: list[Finding]) -> list[Finding]:
    """Return a finding for every tag without a pose that none of ``findings`` is about."""
    said = {finding.tag_index for finding in findings}
    lost = [tag for tag in np.flatnonzero(~chosen.good).tolist() if tag not in said]
    detail = "the pose between two key tags, or the cut to it, cannot be run"
    hint = 'strategies "global" and "each" look for a pose of this tag'
    return [failure(problem, tag, Reason.SINGULAR, detail, hint) for tag in lost]


def _report(problem: Problem, loss: FloatArray, tags: IndexArray) -> Finding:
    text = f"{len(tags)} of {len(problem)} tags are key tags"
    if np.isfinite(loss).any():
        worst = int(np.nanargmax(loss))
        text += (
            f"; loss against each tag's own optimum: mean {100.0 * float(np.nanmean(loss)):.2f} %, "
            f"largest {100.0 * float(loss[worst]):.2f} % at tag {problem.toolpath.tag_name(worst)}"
        )
    bound = problem.cell.optimize.loss_bound
    if not np.nan_to_num(loss, nan=0.0).max(initial=0.0) > bound:
        return Finding(Severity.NOTE, "PLN304", text)
    return Finding(
        Severity.WARNING,
        "PLN305",
        f"{text}; no cuts that can be run keep it under the bound of {100.0 * bound:.0f} %",
        hint='strategy "each" keeps every tag at its optimum, "global" weighs it against travel',
    )
