"""Rows of different designs in one campaign, and whether an effect holds from one to another.

A selection made inside one design of poses need not hold in another: what fits a grid at one
orientation may be wrong at random ones. So rows are told apart by how they were laid out: labels
of the file, sweeps of single joints, a constant tool orientation. An effect is then fitted without
one design and judged on it, where the frames may adapt (leave one group out, as Roberts et al.
2017, Ecography 40, 913, ask for where predictions are to leave the sampled region).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from postproc.arrays import FloatArray, IntArray, Rows
from postproc.gap.choice import Choice
from postproc.gap.data import Samples
from postproc.gap.fit import NormalEquations, Problem, Regression
from postproc.records import dataclass
from postproc.units import DEG

HARM = 12.0
"""Nats of harm on one design that refuse an effect, and their share of all it brings."""
_HARM_SHARE = 0.1
_CLEAR = 2.0
"""So many standard deviations an effect is to be expected to bring something."""
_TIMES = ("first half of the time", "second half of the time")
FEWEST = 12
"""Rows of a design; a smaller one says nothing of its own."""
LARGEST = 8
"""Designs told apart; of more orientations the nearest ones are taken together."""
_SHARE = 0.05
_COVERED = 0.8
_STILL = 0.05 * DEG
"""A joint stands within this."""
_ALIKE = 1.5 * DEG
"""Tool orientations within this are one."""
_APART = 0.05
"""Spread of the points [m] from which rows of one orientation are a grid, not a repeat."""


@dataclass(frozen=True, slots=True)
class Designs:
    """Labels (n,) 0..k-1 of rows, the names of the k designs, and what they were told by.

    source: "group", "layout", or "" where all rows are of one design.
    """

    label: IntArray
    names: tuple[str, ...]
    source: str

    def __len__(self) -> int:
        """Return the number of designs."""
        return len(self.names)

    def rows(self, index: Rows) -> Designs:
        """Return the labels of some rows; a design may be left without any."""
        return Designs(self.label[index], self.names, self.source)


def designs(samples: Samples, group: Sequence[str] | None = None) -> Designs:
    """Return the designs of a campaign.

    Args:
        samples: rows in the order of measuring.
        group: labels of the file; they are taken where few of them hold most rows.
    """
    n = len(samples)
    if group is not None and len(group) == n:
        named = _of_labels(np.array(group), "")
        if len(named) > 1 and named.source:
            return Designs(named.label, named.names, "group")
    sweep = _sweeps(samples.q)
    turn = _orientations(samples)
    words = [
        f"sweep of A{s}" if s else f"orientation {t}" if t else "varied poses"
        for s, t in zip(sweep, turn, strict=True)
    ]
    return _of_labels(np.array(words), "layout")


def _of_labels(words: FloatArray, source: str) -> Designs:
    """Return labels by size; small ones are one design together, or go to the largest."""
    n = len(words)
    found, index, counts = np.unique(words, return_inverse=True, return_counts=True)
    enough = max(FEWEST, _SHARE * n)
    order = [int(k) for k in np.argsort(-counts, kind="stable") if counts[k] >= enough]
    if len(order) < 2 or len(order) > LARGEST or counts[order].sum() < (_COVERED * n):
        return Designs(np.zeros(n, dtype=np.int32), ("all",), "")
    names = [str(found[k]) for k in order]
    number = np.full(len(found), -1, dtype=np.int32)
    number[order] = np.arange(len(order))
    label = number[index]
    rest = label < 0
    if int(rest.sum()) >= FEWEST:
        names.append("others")
        label[rest] = len(names) - 1
    else:
        label[rest] = 0
    return Designs(label, tuple(names), source or "group")


def _sweeps(q: FloatArray) -> IntArray:
    """Return (n,) the joint 1..6 that alone moves in a run of rows, 0 elsewhere."""
    moving = np.abs(np.diff(q, axis=0)) > _STILL
    alone = np.where(moving.sum(axis=1) == 1, np.argmax(moving, axis=1) + 1, 0)
    out = np.zeros(len(q), dtype=np.int32)
    start = 0
    for end in range(1, len(alone) + 1):
        if end == len(alone) or alone[end] != alone[start]:
            if alone[start] and end - start + 1 >= FEWEST:
                out[start : end + 1] = alone[start]
            start = end
    return out


def _orientations(samples: Samples) -> IntArray:
    """Return (n,) the number 1.. of a tool orientation that many rows at other places share."""
    R = samples.frames[:, 6, :3, :3].reshape(len(samples), 9)
    left = np.ones(len(R), dtype=bool)
    out = np.zeros(len(R), dtype=np.int32)
    centres: list[FloatArray] = []
    # a rotation by a small angle moves the nine numbers by sqrt(2) times it
    limit = (2.0**0.5 * _ALIKE) ** 2
    for row in range(len(R)):
        if not left[row]:
            continue
        near = np.flatnonzero(left & (np.sum((R - R[row]) ** 2, axis=1) < limit))
        left[row] = False
        spread = float(np.ptp(samples.point[near], axis=0).max())
        if len(near) >= FEWEST and spread > _APART:
            left[near] = False
            centres.append(R[near].mean(axis=0))
            out[near] = len(centres)
    return _merged(out, np.array(centres))


def _merged(label: IntArray, centres: FloatArray) -> IntArray:
    """Take the nearest orientations together until there are few."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(centres) <= LARGEST - 2:
        return label
    cluster = fcluster(linkage(centres, "ward"), LARGEST - 2, "maxclust")
    return np.asarray(np.concatenate([[0], cluster])[label], dtype=np.int32)


def transfers(
    regression: Regression, label: Designs, chosen: Sequence[str], *, only_told: bool = False
) -> dict[str, dict[str, float]]:
    """Return what each chosen effect brings on each design when fitted to the others [nats].

    Args:
        regression: rows with their blocks.
        label: designs of these rows.
        chosen: keys of the model beside the frames that are always in it.
        only_told: leave out designs on which an effect might bring nothing even if it were as all
            rows have it: too little of it shows there, or the others hardly tell its numbers.

    Returns:
        By effect and design: half the fall of the squared misfit, in units of the noise. Below
        zero the effect, as the other designs have it, makes this one worse. Empty for one design.
    """
    parts = {}
    for k, name in enumerate(label.names):
        rows = np.flatnonzero((label.label == k) & (regression.weight > 0))
        if len(rows) >= FEWEST:
            parts[name] = regression.equations_at(rows)
    if len(parts) < 2:
        return {}
    whole = reduce(NormalEquations.plus, parts.values())
    frames = tuple(regression.always)
    found: dict[str, dict[str, float]] = {}
    for key in chosen:
        rest = tuple(k for k in chosen if k != key)
        alone = whole.numbers((*frames, *rest))[len(whole.index(frames)) :]
        found[key] = {}
        for name, part in parts.items():
            others = whole.minus(part)
            if only_told and _is_open(whole, part, others, (*frames, *chosen), key):
                continue
            own = _beside(whole, others, frames, rest, key)
            without, with_ = (
                _left(part, numbers, keys, frames)
                for numbers, keys in ((alone, rest), (own, (*rest, key)))
            )
            found[key][name] = 0.5 * (without - with_)
    return found


def _is_open(
    whole: NormalEquations,
    part: NormalEquations,
    others: NormalEquations,
    keys: tuple[str, ...],
    key: str,
) -> bool:
    """Return whether a true effect might bring nothing on a part, fitted to the other rows.

    Loads that are put on once are on in one half of the time. What an effect is expected to bring
    is half of what it is there less half of how unsure it is, in squared noise; the noise of the
    part scatters that by the root of the former.
    """
    i, at = whole.index((key,)), np.isin(whole.index(keys), whole.index((key,)))
    G = part.reduced()[0][np.ix_(i, i)]
    theta, C = whole.numbers(keys)[at], others.solve(keys)[1][np.ix_(at, at)]
    size = float(theta @ G @ theta)
    return bool(0.5 * (size - float(np.sum(C * G))) <= _CLEAR * size**0.5)


def _beside(
    whole: NormalEquations,
    others: NormalEquations,
    frames: tuple[str, ...],
    rest: tuple[str, ...],
    key: str,
) -> FloatArray:
    """Return the numbers of a model in which one effect is fitted without some rows.

    Its company keeps the numbers that all rows give it: what two effects share on the other rows
    is no fault of either.
    """
    company = whole.numbers((*frames, *rest, key))[len(whole.index(frames)) :]
    company = company[: len(whole.index(rest))]
    i, r = others.index((*frames, key)), others.index(rest)
    G, b, _ = others.reduced()
    own = np.linalg.solve(G[np.ix_(i, i)] + np.eye(len(i)), b[i] - G[np.ix_(i, r)] @ company)
    return np.concatenate([company, own[len(whole.index(frames)) :]])


def _left(
    part: NormalEquations, effects: FloatArray, keys: tuple[str, ...], frames: tuple[str, ...]
) -> float:
    """Return the squared misfit of a part under the numbers of effects, frames adapted."""
    i, a = part.index(keys), part.index(frames)
    G, b, whole = part.reduced()
    total = whole - float(effects @ (2.0 * b[i] - G[np.ix_(i, i)] @ effects))
    if len(a) == 0:
        return total
    left = b[a] - G[np.ix_(a, i)] @ effects
    return total - float(left @ np.linalg.solve(G[np.ix_(a, a)] + np.eye(len(a)), left))


def refusals(problem: Problem, regression: Regression, choice: Choice) -> tuple[str, ...]:
    """Return the named effects that do not hold where they were not fitted.

    An effect must bring something, all in all, on designs, stations and halves of the time that it
    was not fitted to, and do harm on no design. Places are left out in turn where effects are
    weighed: across half of the workspace even the right numbers do not carry.
    """
    index = np.flatnonzero(problem.searchable)
    keys = (*choice.adopted, *choice.resembled)
    worst: dict[str, float] = {}
    for label, strict in _divisions(problem):
        told = transfers(regression, label.rows(index), keys, only_told=not strict)
        for key, by in told.items():
            if key not in choice.adopted or not by:
                continue
            total, least = sum(by.values()), min(by.values())
            harm = strict and least < -max(HARM, _HARM_SHARE * total)
            if total <= 0.0 or harm:
                worst[key] = min(worst.get(key, 0.0), least, total)
    return tuple(sorted(regression.name(key) for key in worst))


def _divisions(problem: Problem) -> list[tuple[Designs, bool]]:
    """Return ways to part the rows, and whether each part is a design of its own."""
    samples = problem.samples
    found = [(designs(samples, problem.measurements.group), True)]
    if len(problem.set_ups.stations) > 1:
        found.append((_numbered(problem.set_ups.station, problem.set_ups.stations), True))
    stretch = problem.split.stretch
    found.append((_numbered((stretch > np.median(stretch)).astype(np.int32), _TIMES), False))
    return found


def _numbered(label: IntArray, names: tuple[str, ...]) -> Designs:
    return Designs(label, names, "layout")


def is_worse(regression: Regression, choice: Choice) -> bool:
    """Return whether the named effects together are not clearly better than none on other rows.

    What they bring on the places that they were not fitted to has to exceed its own standard
    error. Judged as a model file is used: alternatives are fitted beside the named effects and do
    not stay, the frames are those of the named effects alone.
    """
    keys, frames = choice.adopted, tuple(regression.always)
    whole = regression.equations_at(np.arange(len(regression.y)))
    gains = []
    for part in regression.fold_equations():
        others = whole.minus(part)
        inside = (*frames, *keys, *choice.resembled)
        theta = others.solve(inside)[0][: len(part.index((*frames, *keys)))]
        f, n = part.index(frames), part.index(keys)
        if len(f):
            G, b, _ = others.reduced()
            effects = theta[len(f) :]
            left = b[f] - G[np.ix_(f, n)] @ effects
            theta[: len(f)] = np.linalg.solve(G[np.ix_(f, f)] + np.eye(len(f)), left)
        before = part.misfit(frames, others.solve(frames)[0])
        gains.append(before - part.misfit((*frames, *keys), theta))
    error = np.sqrt(len(gains)) * np.std(gains, ddof=1) if len(gains) > 1 else 0.0
    return bool(gains) and bool(np.sum(gains) <= error)
