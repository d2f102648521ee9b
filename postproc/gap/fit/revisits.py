"""Noise of a static gap from poses that were measured again, before any effect is fitted.

Repeats nearly always differ in approach, temperature or load. They are repeats after these are
regressed out: what they do lives in the joints, so that all three axes and all revisited poses
share six numbers for each of them. What is left scatters by the noise, and its course in time tells
how much of that is a slow wander of the measuring device.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.data import Samples, column_functions
from postproc.measurement import robust_sigma
from postproc.records import dataclass
from postproc.units import DEG

_SAME_GIVE = 1e-5
"""Loads that move the point by as much or less [m] are one."""
SAME_POSE = 0.01 * DEG
FEWEST = 6
"""Degrees of freedom from which the scatter of repeats is an estimate."""
DRIFT = 3.0
"""Wander over white noise from which it is a finding of its own, not noise."""
ENOUGH = 12
"""The same of repeats under equal conditions, from which the others do not count."""
_CLEARLY = 0.7
"""Ratio of the scatter with and without earlier loads from which they explain it."""
_USUAL = 2e-4
"""Sd of the prior of a turn of a joint [rad] that a condition at its usual size brings."""
_FIRST = 2e-5
"""Noise [m] that weighs this prior before there is an estimate."""
_NEIGHBOURS = 6
_CLOSE, _USUALLY_CLOSE = 0.35, 0.0114
"""Distance of two readings over their scatter (per axis), and the share of noise that lies below:
where many more do than chance lets them, and at least this share, there are two scatters."""
_MANY, _CHANCE = 0.05, 1e-5
_ROUNDS = 8
_FAULT = 6.0
_MOST_FAULTS = 0.15
_LARGEST = 240
"""Rows that the course in time is estimated from."""
_SURE = 3.0
"""Nats that a wander must bring."""
_FREE = 20.0
"""Sd of the prior of a ramp or step, in white noise."""
_SPLITS = 40
_RATIOS = (0.5, 1.0, 2.0, 4.0)
_SHARES = (0.01, 0.03, 0.1, 0.3)
"""Wander over white noise, and its correlation time over the length of the campaign."""
_WANDERS, _WHITES = np.geomspace(0.25, 8.0, 11), (0.25, 0.5, 0.7, 1.0)
"""Wanders that readings may refute, and the white noise beside one, over that without any."""
_READINGS = 3.0
"""Time between readings that a correlation time must have, to be told from white noise."""


WanderBounds = tuple[tuple[float, float], ...]
"""Correlation times [s], each with the largest wander [m] that readings of one pose let be."""


@dataclass(frozen=True, slots=True)
class Revisits:
    """What scatters between readings of the same pose.

    rows: (m,) in the campaign; group: (m,) pose of each; rest: (m, 3) what the conditions leave of
    the differences [m]; sigma: [m] per axis, NaN without any; white, wander: [m] its two parts;
    correlation: [s] of the wander, NaN where there is none or no clock; drift: "ramp" or "step"
    taken out of white and wander, else empty; freedom: what it rests on; bounds: what a wander has
    at most where the readings tell that.
    """

    rows: IntArray
    group: IntArray
    rest: FloatArray
    sigma: float
    freedom: float
    white: float
    wander: float = 0.0
    correlation: float = float("nan")
    drift: str = ""
    bounds: WanderBounds = ()

    @property
    def noise(self) -> float:
        """Noise per axis [m]: white, and the wander as far as it is no drift."""
        return float(np.hypot(self.white, self.wander if self.wander < DRIFT * self.white else 0.0))

    @property
    def sufficient(self) -> bool:
        """Whether the freedom is enough for an estimate."""
        return self.freedom >= FEWEST


def revisits(samples: Samples, y: FloatArray, usable: BoolArray, unit: IntArray) -> Revisits:
    """Return the scatter of revisited poses.

    Readings from the same side, under the same load and at the same speed count alone where there
    are enough of them: nothing but the temperature has to be regressed out. Readings under
    different loads, or of different labels (a tool, a fixture), are no repeats at all: how a pose
    gives under a load, or what a tool is off by, is what is sought. What
    earlier loads have left, and what follows a column that no effect knows, is regressed out where
    that clearly explains the scatter: it looks like a drift of the measuring device, or like noise.

    Args:
        samples: rows.
        y: (n, 3) gap [m].
        usable: (n,) rows that are no faults.
        unit: (n,) set-up of the measuring device: rows of others are no repeats.
    """
    bare = replace(samples, past=None, extra={})
    unit = _labelled(samples, unit)
    found = _revisits(bare, y, usable, unit)
    more = [replace(bare, past=samples.past)] if _is_any(samples.past) else []
    more += [replace(bare, extra={name: column}) for name, column in samples.extra.items()]
    for richer in more:
        held = _revisits(richer, y, usable, unit)
        if not held.sufficient:
            continue
        scatter = [np.hypot(r.white, r.wander) for r in (held, found)]
        found = held if scatter[0] < _CLEARLY * scatter[1] else found
    return found


def _labelled(samples: Samples, unit: IntArray) -> IntArray:
    """Return set-ups (n,), parted further by the columns that hold labels."""
    parts: list[NDArray[Any]] = [unit]
    for values in samples.extra.values():
        functions = column_functions(values)
        if np.asarray(values).dtype.kind not in "fiu" and functions.size:
            parts.append(np.unique(values, return_inverse=True)[1].ravel())
    return np.unique(np.stack(parts), axis=1, return_inverse=True)[1].ravel().astype(np.int32)


def _is_any(values: FloatArray | None) -> bool:
    return values is not None and bool(np.any(values))


def repeats(samples: Samples, unit: IntArray) -> IntArray:
    """Return the number (n,) of what each row is a pure repeat of, under equal conditions."""
    key = np.column_stack([_place(samples, _labelled(samples, unit)), *_alike(samples)])
    return np.unique(key, axis=0, return_inverse=True)[1].ravel().astype(np.int32)


def _place(samples: Samples, unit: IntArray) -> FloatArray:
    return np.column_stack([unit[:, None], np.round(samples.q / SAME_POSE), _give(samples)])


def _revisits(samples: Samples, y: FloatArray, usable: BoolArray, unit: IntArray) -> Revisits:
    place = _place(samples, unit)
    found = _scatter(samples, y, usable, unit, np.column_stack([place, *_alike(samples)]))
    if found.freedom >= ENOUGH:
        return found
    return _scatter(samples, y, usable, unit, place)


def _give(samples: Samples) -> FloatArray:
    """Return (n, 3) how far the joints let the load move the point, roughly, in whole steps."""
    if samples.wrench is None:
        return np.zeros((len(samples), 0))
    turn = samples.load_torque() * samples.arm.reference.c_joint
    return np.asarray(np.round(np.einsum("nij,nj->ni", samples.jacobian, turn) / _SAME_GIVE))


def _alike(samples: Samples) -> list[FloatArray]:
    """Return rounded conditions (n, k) that the rows of a pure repeat share."""
    found = []
    if samples.direction is not None:
        found.append(samples.direction)
    if samples.wrench is not None:
        found.append(np.round(samples.wrench / 5.0))
    if samples.qd is not None:
        found.append(np.round(samples.qd / (0.1 * DEG)))
    return found


def _scatter(
    samples: Samples, y: FloatArray, usable: BoolArray, unit: IntArray, key: FloatArray
) -> Revisits:
    """Return the scatter of rows that have the same key."""
    rows, group = _groups(key, usable)
    if len(rows) == 0:
        return Revisits(rows, group, np.zeros((0, 3)), np.nan, 0.0, np.nan)
    keep = np.ones(len(rows), dtype=bool)
    sigma = _FIRST
    for _ in range(_ROUNDS):
        rest, freedom = _regressed(samples.rows(rows), y[rows], group, keep, sigma)
        length = np.where(keep, np.linalg.norm(rest, axis=1), 0.0)
        spread = robust_sigma(length[keep]) * np.sqrt(3.0 * keep.sum() / max(freedom, 1.0))
        sigma = max(float(np.sqrt(np.sum(rest[keep] ** 2) / max(freedom, 1.0))), 1e-9)
        # a fault pulls at the mean of its pose: the worst row of each goes first
        worst = length >= _largest(length, group)
        bad = worst & (length > _FAULT * max(spread, 1e-9))
        # of a pose one reading is the fault, whichever it is that the mean lies between
        if not bad.any() or len(np.unique(group[~keep | bad])) > _MOST_FAULTS * len(rows):
            break
        keep &= ~bad
    rows, group, rest = rows[keep], group[keep], rest[keep]
    group = np.unique(group, return_inverse=True)[1].astype(np.int32)
    pure, pairs = _among_alike(rest, group)
    if pairs:
        return Revisits(rows, group, rest, pure, 3.0 * pairs, pure)
    course = _course(samples.rows(rows), rest, group, unit[rows], sigma)
    return Revisits(rows, group, rest, sigma, freedom, *course)


def _among_alike(rest: FloatArray, group: IntArray) -> tuple[float, int]:
    """Return the noise [m] of readings that are alike where many of the others are not, and pairs.

    A condition that nobody logged (side, load) parts the readings of a pose: then far more of them
    lie close together than noise of their whole scatter lets them. No pairs: there is one scatter.
    What the conditions take from every reading brings all of them together, and says nothing.
    """
    from scipy.special import pdtrc

    order = np.argsort(group, kind="stable")
    apart = []
    for step in range(1, _NEIGHBOURS):
        same = group[order[step:]] == group[order[:-step]]
        between = rest[order[step:]] - rest[order[:-step]]
        apart.append(np.linalg.norm(between[same], axis=1))
    distance = np.concatenate(apart)
    scatter = float(np.sqrt(np.mean(distance**2) / 3.0))
    close = distance[distance < _CLOSE * scatter]
    by_chance = float(pdtrc(len(close) - 1.0, _USUALLY_CLOSE * len(distance)))
    if by_chance > _CHANCE or len(close) < _MANY * len(distance):
        return float("nan"), 0
    return robust_sigma(close) / float(np.sqrt(2.0)), len(close)


def _largest(values: FloatArray, group: IntArray) -> FloatArray:
    """Return for each row the largest value of its group."""
    most = np.zeros(int(group.max()) + 1)
    np.maximum.at(most, group, values)
    return np.asarray(most[group])


def _groups(key: FloatArray, usable: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the rows whose key occurs more than once, and the number of each key."""
    label = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    counts = np.bincount(label, weights=usable.astype(float))
    rows = np.flatnonzero(usable & (counts[label] > 1)).astype(np.int32)
    return rows, np.unique(label[rows], return_inverse=True)[1].astype(np.int32)


def _conditions(samples: Samples) -> FloatArray:
    """Return (m, 3, k) what each condition moves, per usual size."""
    J = samples.jacobian
    parts = []
    if samples.direction is not None:
        parts.append(J * samples.direction[:, None, :])
    if samples.temperature is not None:
        warm = (samples.temperature - samples.temperature.mean()) / 10.0
        parts.append(J * warm[:, None, None])
        grown = np.concatenate([np.tile(np.eye(3), (len(J), 1, 1)), samples.point[:, :, None]], 2)
        parts.append(grown * warm[:, None, None])
    if samples.wrench is not None:
        turn = samples.load_torque() * samples.arm.reference.c_joint
        parts.append(J * (turn / _USUAL)[:, None, :])
    if samples.past is not None:
        past = samples.past.reshape(len(J), -1, 6) * samples.arm.reference.c_joint / _USUAL
        parts += [J * past[:, k, None, :] for k in range(past.shape[1])]
    if samples.qd is not None:
        parts.append(J * (0.01 * samples.qd / _USUAL)[:, None, :])
    shift = np.concatenate([np.tile(np.eye(3), (len(J), 1, 1)), samples.frames[:, 6, :3, :3], J], 2)
    for values in samples.extra.values():
        parts += [shift * of[:, None, None] for of in column_functions(values).T]
    whole = np.concatenate(parts, axis=2) if parts else np.zeros((len(J), 3, 0))
    return np.asarray(whole[:, :, np.any(whole != 0.0, axis=(0, 1))])


def _regressed(
    samples: Samples, y: FloatArray, group: IntArray, keep: BoolArray, sigma: float
) -> tuple[FloatArray, float]:
    """Return (m, 3) what the conditions leave of the differences, and the freedom of it."""
    X = _conditions(samples)
    centred = [_without_means(v, group, keep) for v in (X.reshape(len(X), 3 * X.shape[2]), y)]
    A, b = centred[0].reshape(X.shape), centred[1]
    K = A[keep].reshape(3 * int(keep.sum()), X.shape[2])
    penalty = (sigma / _USUAL) ** 2 * np.eye(X.shape[2])
    H = K.T @ K
    theta = np.linalg.solve(H + penalty, K.T @ b[keep].ravel()) if X.shape[2] else np.zeros(0)
    taken = float(np.trace(np.linalg.solve(H + penalty, H))) if X.shape[2] else 0.0
    poses = len(np.unique(group[keep]))
    return b - A @ theta, 3.0 * (keep.sum() - poses) - taken


def _without_means(values: FloatArray, group: IntArray, keep: BoolArray) -> FloatArray:
    count = int(group.max()) + 1
    weight = np.bincount(group[keep], minlength=count)
    mean = np.zeros((count, values.shape[1]))
    np.add.at(mean, group[keep], values[keep])
    mean /= np.maximum(weight, 1)[:, None]
    return np.asarray(values - mean[group])


def _course(
    samples: Samples, rest: FloatArray, group: IntArray, unit: IntArray, sigma: float
) -> tuple[float, float, float, str, WanderBounds]:
    """Return white noise, wander [m], its correlation time [s], the drift, bounds of a wander.

    First-order wander (Ornstein and Uhlenbeck), a ramp or a step beside white noise, by the
    restricted likelihood of the differences within each pose; white alone unless more is clearly
    there.
    """
    from scipy.linalg import null_space

    nothing: tuple[float, float, float, str, WanderBounds] = (sigma, 0.0, float("nan"), "", ())
    if len(rest) < 2 * FEWEST:
        return nothing
    few = np.sort(np.argsort(group, kind="stable")[:_LARGEST])
    time, unit, rest = samples.course[few], unit[few], rest[few]
    N = null_space(np.eye(int(group.max()) + 1)[group[few]].T)
    if N.shape[1] < FEWEST:
        return nothing
    data, white = N.T @ rest, np.eye(N.shape[1])
    same = np.exp(-np.abs(time[:, None] - time)[None] / _scales(time)[:, None, None])
    waves = [N.T @ (C * (unit[:, None] == unit)) @ N for C in same]
    bounds = tuple(
        (float(share), _refuted(C, data, sigma))
        for share, C in zip(_scales(time), waves, strict=True)
    )
    best, found, chosen = _restricted(white, data)[0] + _SURE, (*nothing[:4], bounds), white
    for share, C in zip(_scales(time), waves, strict=True):
        for ratio in _RATIOS:
            value, s = _restricted(white + ratio**2 * C, data)
            if value > best:
                scale = sigma / np.hypot(1.0, ratio)
                best, found, chosen = value, (scale, ratio * scale, float(share), "", ()), C
    calm = [(white, 0.0, float("nan"))]
    if found[1]:
        calm.append((white + chosen, 1.0, found[2]))
    for drift, form, price in _drifts(time):
        g = N.T @ form
        for C, ratio, share in calm:
            value, s = _restricted(C + _FREE**2 * np.outer(g, g), data)
            if value - price > best + _SURE:
                best, found = value - price, (s, ratio * s, share, drift, ())
    return found


def _refuted(C: FloatArray, data: FloatArray, sigma: float) -> float:
    """Return the wander [m] that differences (k, 3) refute, of correlation C beside white noise."""
    of_wander, axes = np.linalg.eigh(C)
    square = np.sum((axes.T @ data) ** 2, axis=1)

    def likelihood(wander: float, white: float) -> float:
        variance = white**2 + wander**2 * of_wander
        return float(-0.5 * np.sum(square / variance) - 1.5 * np.sum(np.log(variance)))

    least = likelihood(0.0, sigma) - _SURE
    for wander in sigma * _WANDERS:
        if max(likelihood(wander, sigma * share) for share in _WHITES) < least:
            return float(wander)
    return float("inf")


def _scales(time: FloatArray) -> FloatArray:
    """Return the correlation times [s] tried: what is shorter than readings show is white noise."""
    scales = np.array(_SHARES) * (float(np.ptp(time)) or 1.0)
    apart = np.diff(np.unique(time))
    return np.asarray(scales[scales >= _READINGS * (np.median(apart) if len(apart) else 0.0)])


def _drifts(time: FloatArray) -> list[tuple[str, FloatArray, float]]:
    """Return a ramp and steps of time, each with the price of the search for it [nats]."""
    part = (time - time.min()) / (float(np.ptp(time)) or 1.0)
    splits = np.unique(time)[2:-2]
    splits = splits[:: max(1, len(splits) // _SPLITS)]
    steps = [("step", (time > at).astype(float), float(np.log(len(splits)))) for at in splits]
    return [("ramp", part, 0.0), *steps]


def _restricted(C: FloatArray, data: FloatArray) -> tuple[float, float]:
    """Return the log likelihood of differences (k, 3) with covariance s^2 C, and the best s."""
    L = np.linalg.cholesky(C)
    z = np.linalg.solve(L, data)
    square = float(np.sum(z**2)) / data.size
    value = -0.5 * data.size * np.log(max(square, 1e-30)) - 3.0 * float(np.sum(np.log(np.diag(L))))
    return value, float(np.sqrt(square))
