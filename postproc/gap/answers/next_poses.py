"""What to measure next: the poses and loads that tell apart what the rows do not.

For each set of effects that explain the rows equally well, poses are added one by one where the
rival, fitted to all rows so far, would be refuted most if the other were true. With M the
information on an effect's numbers that its rivals cannot imitate (its Schur complement in the
joint information, whose determinant a D_s-optimal design maximises) and theta what was fitted, the
separation is sqrt(theta' M theta): a T-optimal design (Atkinson and Fedorov 1975, Biometrika 62,
57), for that direction of theta that is in question.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.gap.answers.diagnose import Diagnosis
from postproc.gap.answers.next_pose import APPROACH, NextPose, Reach
from postproc.gap.data import Samples, make_samples
from postproc.gap.effect import EFFECTS
from postproc.gap.posterior import of_effect, optimum
from postproc.gap.robot_model import effect_of, evaluate
from postproc.geometry import apply
from postproc.measurement import rigid_motion
from postproc.records import dataclass
from postproc.units import DEG

ENOUGH = 8.0
"""Separation [sigma] at which no further pose is added: the wrong effect is then rejected in all
but one of thousands of campaigns."""
_DRAWN, _CANDIDATES = 16000, 1500
_FEWEST, _MOST = 6, 30
_LOADS = 6
_BEYOND = 0.5
"""Tool points [m] beyond the measured ones; none is lower than those, there may be a floor."""
_REVISITED, _READINGS = 3, 5
"""Poses to measure again, and how often."""
_LATER = 600.0
"""When it will be measured, after the last row [s]."""
_OF_THE_POSE = ("neighbouring poses", "position", *(f"q{i}" for i in range(1, 7)))
"""Conditions of the rest that cannot be varied at one pose."""
_SEED = 17


def next_poses(diagnosis: Diagnosis, reach: Reach | None = None) -> tuple[NextPose, ...]:
    """Return what to measure next; nothing if nothing is ambiguous and all is explained.

    First what tells the noise where it is not known, then what tells ambiguous effects apart, then
    what tells of a rest that nothing explains.
    """
    reach = reach or Reach()
    found: list[NextPose] = []
    if not diagnosis.level.known:
        found += _revisits(diagnosis, reach)
    for question in questions(diagnosis):
        found += discriminating(diagnosis, question, reach)
    if diagnosis.verdict == "unexplained":
        found += _worst(diagnosis, reach)
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Question:
    """A set that the rows cannot tell apart.

    models: keys of the models in competition; names: theirs; effects: all that are in question.
    """

    models: tuple[tuple[str, ...], ...]
    names: tuple[str, ...]
    effects: tuple[str, ...]

    @property
    def why(self) -> str:
        """What measuring answers."""
        return f"tells {self.names[0]} from {' or '.join(self.names[1:])}"


def questions(diagnosis: Diagnosis) -> tuple[Question, ...]:
    """Return the ambiguous sets of a diagnosis, each once."""
    of, search = diagnosis.judged.posterior, diagnosis.judged.posterior.search
    has_effect = {k for k, c in search.equations.by_key.items() if c.effect is not None}
    whole = tuple(k for k in diagnosis.judged.whole.keys if k in has_effect)
    found: list[Question] = []
    asked: list[set[str]] = []
    for name in diagnosis.judged.adopted:
        names = {name.name, *name.confounded}
        if not name.confounded or names in asked:
            continue
        asked.append(names)
        rest = tuple(k for k in whole if k not in name.keys)
        rivals = {}
        for rival in name.confounded:
            with_it = [
                s
                for s in search.found
                if any(of.candidate(k).name == rival for k in s)
                and all(of.candidate(k).name != name.name for k in s)
            ]
            best = max(with_it, key=lambda s: (search.score(s), s))
            own = tuple(k for k in best if of.candidate(k).name == rival)
            rivals[rival] = (*rest, *(k for k in own if k not in rest))
        words = (name.name, *rivals)
        found.append(Question((whole, *rivals.values()), words, words))
    return tuple(found)


@dataclass(slots=True)
class _Comparison:
    """One model taken for true and a rival fitted to what it would give, row by row.

    true: name of the first; truth: (n, 3) what it gives, and X: (n, 3, p) columns of the other,
    both in sigma; H, seen: normal equations of the other; square: [sigma^2] of what refutes it.
    """

    true: str
    truth: FloatArray
    X: FloatArray
    H: FloatArray
    seen: FloatArray
    square: float = 0.0

    def gains(self, rows: slice = slice(None)) -> FloatArray:
        """Return (n,) the square [sigma^2] by which each candidate would refute the rival."""
        X, inverse = self.X[rows], np.linalg.inv(self.H)
        miss = self.truth[rows] - X @ (inverse @ self.seen)
        S = np.eye(3) + X @ inverse @ np.swapaxes(X, 1, 2)
        scaled = np.linalg.solve(S, miss[:, :, None])[:, :, 0]
        return np.asarray(np.einsum("ni,ni->n", miss, scaled))

    def take(self, row: int) -> None:
        """Measure a candidate."""
        self.square += float(self.gains(slice(row, row + 1))[0])
        A = self.X[row]
        self.H = self.H + A.T @ A
        self.seen = self.seen + A.T @ self.truth[row]


def discriminating(diagnosis: Diagnosis, question: Question, reach: Reach) -> list[NextPose]:
    """Return what separates the models of a question, chosen one by one for the worst pair."""
    pool = candidates(diagnosis, question.effects, reach)
    if len(pool) == 0:
        return []
    comparisons = _comparisons(diagnosis, question, pool)
    chosen: list[int] = []
    while len(chosen) < min(_MOST, len(pool)):
        least = min(one.square for one in comparisons)
        if len(chosen) >= _FEWEST and least >= ENOUGH**2:
            break
        # the sum of logarithms pushes the pair that is behind, and never stands still
        gain = sum(np.log1p(one.square + one.gains()) for one in comparisons)
        score = np.asarray(gain, dtype=np.float64)
        score[chosen] = -np.inf
        best = int(np.argmax(np.round(score, 9)))
        chosen.append(best)
        for one in comparisons:
            one.take(best)
    return _poses(diagnosis, pool.rows(np.array(chosen)), question.why, _separations(comparisons))


def _comparisons(diagnosis: Diagnosis, question: Question, pool: Samples) -> list[_Comparison]:
    of = diagnosis.judged.posterior
    equations, noise = of.search.equations, diagnosis.noise
    actual = evaluate(pool, diagnosis.problem.given)[1]
    always = of.search.always

    def far(key: str) -> FloatArray:
        c = of.candidate(key)
        effect, setting = effect_of(c.name), c.setting or {}
        return np.asarray(of_effect(effect, actual, setting, key, key in always).X / noise)

    columns = {k: far(k) for model in question.models for k in model}
    fits = [
        optimum(equations, model, of.prior, diagnosis.judged.whole) for model in question.models
    ]
    comparisons = []
    for one, name in zip(fits, question.names, strict=True):
        truth = np.concatenate([columns[k] for k in one.keys], axis=2) @ one.theta
        i = equations.among(one.keys)[0]
        for two in fits:
            if two is one:
                continue
            j, G, _ = equations.among(two.keys)
            H = G / noise**2 + np.diag(two.deviation**-2)
            seen = equations.A[:, j].T @ (equations.A[:, i] @ one.theta) / noise**2
            X = np.concatenate([columns[k] for k in two.keys], axis=2)
            comparisons.append(_Comparison(name, truth, X, H, seen))
    return comparisons


def reassessed(diagnosis: Diagnosis, poses: Sequence[NextPose]) -> tuple[NextPose, ...]:
    """Return poses with the separations that they reach together, after some were left out."""
    asked = {question.why: question for question in questions(diagnosis)}
    out = list(poses)
    for why, question in asked.items():
        index = [k for k, pose in enumerate(poses) if pose.why == why]
        if index:
            comparisons = _comparisons(
                diagnosis, question, samples_of_poses(diagnosis, [out[k] for k in index])
            )
            for row in range(len(index)):
                for one in comparisons:
                    one.take(row)
            for k in index:
                out[k] = replace(out[k], separations=_separations(comparisons))
    return tuple(out)


def samples_of_poses(diagnosis: Diagnosis, poses: Sequence[NextPose]) -> Samples:
    """Return readings to come as rows."""
    samples = diagnosis.problem.samples
    n = len(poses)
    columns: dict[str, FloatArray] = {}
    for name in ("wrench", "direction"):
        if samples.has(name):
            columns[name] = np.array([getattr(pose, name) for pose in poses])
    if samples.qd is not None:
        columns["qd"] = np.array([np.zeros(6) if p.qd is None else p.qd for p in poses])
    if samples.temperature is not None:
        last = float(samples.temperature[-1])
        now = [last if p.temperature is None else p.temperature for p in poses]
        columns["temperature"] = np.array(now)
    if samples.time is not None:
        columns["time"] = np.full(n, float(samples.time.max()) + _LATER)
    more = {"extra": _as_last(samples, len(poses))}
    return make_samples(samples.arm, np.array([pose.q for pose in poses]), **columns, **more)


def _separations(comparisons: list[_Comparison]) -> dict[str, float]:
    found: dict[str, float] = {}
    for one in comparisons:
        found[one.true] = min(found.get(one.true, np.inf), float(np.sqrt(one.square)))
    return found


def _worst(diagnosis: Diagnosis, reach: Reach) -> list[NextPose]:
    """Return the poses of the largest unexplained rest, from both sides where play may be it."""
    problem = diagnosis.problem
    size = np.linalg.norm(diagnosis.residual, axis=1) * diagnosis.kept
    _, first = np.unique(problem.split.cluster[np.argsort(-size, kind="stable")], return_index=True)
    order = np.argsort(-size, kind="stable")[np.sort(first)]
    rows = problem.samples.rows(order)
    clear = [test.name for test in diagnosis.tests if test.p_value < 1e-3]
    vary = next((name for name in clear if name not in _OF_THE_POSE), "")
    what = f"vary only {vary}" if vary else "and poses around it"
    sides: list[tuple[float | None, str]] = [(None, what)]
    if vary == "approach" or not rows.has("direction"):
        sides = [(side, f"from both sides: approach {side:+.0f}") for side in (1.0, -1.0)]
    good = np.ones(len(rows), dtype=bool)
    for side, _ in sides:
        good &= reach.allows(rows, _from(rows, side) - 0.0)
    rows = rows.rows(np.flatnonzero(good)[:_FEWEST])
    if len(rows) == 0:
        return []
    found = []
    for side, what in sides:
        moved = rows if side is None else _approached(rows, side)
        moved = moved if vary == "temperature" else _as_it_is(moved)
        found += _poses(diagnosis, moved, f"largest unexplained rest; measure again, {what}")
    return [pose for k in range(len(rows)) for pose in found[k :: len(rows)]]


def _revisits(diagnosis: Diagnosis, reach: Reach) -> list[NextPose]:
    """Return a few unloaded poses far apart, each several times from one side, in turn."""
    samples = diagnosis.problem.samples
    index = np.flatnonzero(diagnosis.kept)
    if samples.wrench is not None:
        size = np.linalg.norm(samples.wrench[index, :3], axis=1)
        index = index[size <= np.min(size) + 1e-9]
    rows = _as_it_is(_approached(samples.rows(index), 1.0))
    rows = rows if rows.qd is None else replace(rows, qd=np.zeros_like(rows.qd))
    rows = rows.rows(np.flatnonzero(reach.allows(rows, _from(rows, 1.0))))
    if len(rows) == 0:
        return []
    chosen = _farthest(rows.q, 0, _REVISITED)
    why = f"revisit these poses, {_READINGS} times each from one side: it tells the noise"
    poses = _poses(diagnosis, rows.rows(chosen), why)
    return [replace(pose, revisit=True) for _ in range(_READINGS) for pose in poses]


def _from(rows: Samples, side: float | None) -> FloatArray:
    direction = rows.direction if side is None else np.full(rows.q.shape, side)
    return rows.q if direction is None else np.asarray(rows.q - APPROACH * direction)


def _approached(rows: Samples, side: float) -> Samples:
    return replace(rows, direction=np.full(rows.q.shape, side))


def _as_it_is(rows: Samples) -> Samples:
    """Return rows to be measured at whatever temperature the arm has."""
    if rows.temperature is None:
        return rows
    return replace(rows, temperature=np.full(len(rows), rows.temperature[-1]))


def candidates(diagnosis: Diagnosis, names: tuple[str, ...], reach: Reach) -> Samples:
    """Return poses within the measured joint ranges widened by a third that can be taken.

    Loads and sides are drawn from those measured; speed and temperature only where the effects in
    question need them.
    """
    samples = diagnosis.problem.samples
    kin = samples.arm.kinematics
    rng = np.random.default_rng(_SEED)
    low, high = samples.q.min(axis=0), samples.q.max(axis=0)
    wide = 0.33 * (high - low) + 40.0 * DEG
    low, high = np.maximum(low - wide, kin.q_min), np.minimum(high + wide, kin.q_max)
    q = np.round(rng.uniform(low, high, (_DRAWN, 6)) / DEG, 5) * DEG
    drawn = _conditions(samples, names, rng) | {"extra": _as_last(samples, len(q))}
    pool = make_samples(samples.arm, q, **drawn)
    inside = np.all(
        (pool.point >= samples.point.min(axis=0) - [_BEYOND, _BEYOND, 0.0])
        & (pool.point <= samples.point.max(axis=0) + _BEYOND),
        axis=1,
    )
    pool = pool.rows(np.flatnonzero(inside)[:_CANDIDATES])
    return pool.rows(np.flatnonzero(reach.allows(pool, _from(pool, None))))


def _as_last(samples: Samples, count: int) -> dict[str, Any]:
    """Return what else was logged as it stood last: a rail stays where it is."""
    return {name: np.repeat(np.asarray(v)[-1:], count) for name, v in samples.extra.items()}


def _conditions(
    samples: Samples, names: tuple[str, ...], rng: np.random.Generator
) -> dict[str, FloatArray]:
    needs = {column for name in names for column in dict(EFFECTS)[name].needs}
    n = len(samples)
    drawn: dict[str, FloatArray] = {}
    if samples.direction is not None:
        drawn["direction"] = samples.direction[rng.integers(0, n, _DRAWN)]
    if samples.wrench is not None:
        loads = _loads(samples.wrench)
        drawn["wrench"] = loads[rng.integers(0, len(loads), _DRAWN)]
    if samples.qd is not None:
        row = rng.integers(0, n, _DRAWN)
        drawn["qd"] = samples.qd[row] if "qd" in needs else np.zeros((_DRAWN, 6))
    if samples.temperature is not None:
        row = rng.integers(0, n, _DRAWN) if "temperature" in needs else np.full(_DRAWN, -1)
        drawn["temperature"] = samples.temperature[row]
    if samples.time is not None:
        drawn["time"] = np.full(_DRAWN, float(samples.time.max()) + _LATER)
    return drawn


def _loads(wrench: FloatArray) -> FloatArray:
    """Return a few loads that differ most among those measured: each has to be put on by hand."""
    distinct = np.unique(np.round(wrench, 3), axis=0)
    least = int(np.argmin(np.linalg.norm(distinct, axis=1)))
    return np.asarray(distinct[_farthest(distinct, least, _LOADS)])


def _farthest(points: FloatArray, first: int, count: int) -> IntArray:
    """Return the numbers of some points (n, k), each the farthest from those before it."""
    chosen = [first]
    while len(chosen) < min(count, len(points)):
        apart = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(apart)))
    return np.array(chosen, dtype=np.int32)


def last_set_up(diagnosis: Diagnosis) -> int:
    """Return a row of the station and the reflector that were measured with last."""
    time = diagnosis.problem.samples.time
    return len(diagnosis.problem) - 1 if time is None else int(np.argmax(time))


def _poses(
    diagnosis: Diagnosis, rows: Samples, why: str, separations: Mapping[str, float] | None = None
) -> list[NextPose]:
    problem = diagnosis.problem
    last = last_set_up(diagnosis)
    here = (problem.set_ups.unit == problem.set_ups.unit[last]) & problem.whole
    T_measured_robroot = np.eye(4)
    if problem.seen is None or problem.registration is not None:
        position = np.asarray(problem.measurements.position)
        T_measured_robroot = rigid_motion(problem.measured[here], position[here])
    seen = problem.samples.seen
    expected_of = rows if seen is None else rows.with_points(measured=seen[last])
    states = {n: s for n, s in diagnosis.fit.states.items() if not effect_of(n).of_several}
    expected = apply(T_measured_robroot, evaluate(expected_of, states)[0])

    def of(name: str, row: int) -> Any:  # noqa: ANN401 - a row, a number or None
        return getattr(rows, name)[row] if rows.has(name) else None

    found = []
    varied = rows.temperature is not None and float(np.ptp(rows.temperature)) > 0.0
    for row in range(len(rows)):
        qd, temperature = of("qd", row), of("temperature", row) if varied else None
        found.append(
            NextPose(
                q=rows.q[row],
                why=why,
                expected=expected[row],
                wrench=of("wrench", row),
                direction=of("direction", row),
                temperature=None if temperature is None else float(temperature),
                qd=qd if qd is not None and bool(np.any(qd)) else None,
                separations=separations or {},
            )
        )
    return found
