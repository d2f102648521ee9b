"""Why no cut leads on: what becomes of the poses at the tag before that the search can reach.

Each of them is carried on to the next tag without a turn of the tool about its axis. The search has
refuted every turn of the grid as well; what stops the tool where it does not turn is what a person
can change.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.arrays import FloatArray
from postproc.planning.checks import Break, Reason
from postproc.planning.search.cuts import Judged, Spans, judge

if TYPE_CHECKING:
    from postproc.planning.search.pose_search import PoseSearch

_MOST = 1000
"""So many poses at most are carried on."""


def break_at(search: PoseSearch, row: int) -> Break:
    """Return what stops the poses before a key tag into which no cut leads."""
    states, problem = search.states, search.checker.problem
    before = np.arange(states.offsets[row - 1], states.offsets[row])
    before = before[np.isfinite(search.ladder.value[before])]
    before = before[np.unique(np.linspace(0, len(before) - 1, _MOST).astype(np.int64))]
    m = len(before)
    on_the_way = np.arange(int(search.tags[row - 1]) + 1, int(search.tags[row]) + 1)
    why = Reason(int(search.between.hopeless[on_the_way].max()))
    if m and why is not Reason.NONE:  # such a way may be endless
        return Break(m, {why: m}, -1, 0.0, 0, 0.0)
    first, last = (np.full(m, int(search.tags[at])) for at in (row - 1, row))
    attitude = states.attitude_of(before)
    onward = attitude.copy()
    onward[:, 0] = search.between.spin_of(last, attitude[:, 0] + search.between.carried[first])
    onward[~search.between.may_tilt[last], 1:] = 0.0
    if search.pinned[row]:
        onward[:, 0] = states.spin_of(np.full(m, states.offsets[row]))
    q, branch = states.q[before].astype(np.float64), states.branch[before].astype(np.int64)
    T, external = problem.placement.tcp(last, onward), problem.placement.external[last]
    q_last, _ = problem.solve(T, external, branch, q)
    spans = Spans(first, last, attitude, onward, q, q_last, branch)
    return _told(search, judge(search.checker, search.between, spans), m)


def _told(search: PoseSearch, judged: Judged, count: int) -> Break:
    bad = np.flatnonzero(judged.reason != Reason.NONE)
    bad = bad[np.unique(judged.rows.span[bad], return_index=True)[1]]
    reason, pairs = judged.reason[bad], judged.pair[bad]
    counts = {why: int((reason == why).sum()) for why in Reason if (reason == why).any()}
    pairs, times = np.unique(pairs[pairs >= 0], return_counts=True)
    over, axis = _over(search, judged.q[bad[reason == Reason.JOINT_LIMIT]])
    bent = np.abs(judged.q[bad[reason == Reason.SINGULAR], 4])
    return Break(
        count,
        counts,
        int(pairs[np.argmax(times)]) if len(pairs) else -1,
        over,
        axis,
        float(bent.max(initial=0.0)),
    )


def _over(search: PoseSearch, q: FloatArray) -> tuple[float, int]:
    """Return by how much the least of joints (k, 6) is beyond its limits [rad], and which axis.

    0 where none of them is: those broke a limit on their way.
    """
    arm = search.checker.problem.kinematics
    margin = search.checker.problem.cell.limits.joint_margin
    beyond = np.maximum(np.asarray(arm.q_min) + margin - q, q - np.asarray(arm.q_max) + margin)
    beyond = beyond[beyond.max(axis=1) > 0.0]
    if not len(beyond):
        return 0.0, 0
    least = int(np.argmin(beyond.max(axis=1)))
    return float(beyond[least].max()), int(np.argmax(beyond[least]))
