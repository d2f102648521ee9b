"""What a campaign will be able to tell, before anything of it is measured.

For each effect, numbers are drawn from its prior and scaled to a size; readings of the plan with
noise then give an evidence, as a diagnosis would weigh it beside a free registration: without the
rows that it seals, and only if the effect helps on places and times that it was not fitted to. The
smallest size that is seen in nine of ten draws is told; and for each pair of effects the size from
which the true one beats the other in nine of ten.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.choice import CONFOUNDED, DECISIVE, PRIOR_LIBRARY, SURE, Group, groups_of
from postproc.gap.data import Samples, split
from postproc.gap.effect import Effect, Kind, registration_effects
from postproc.gap.fit import WIDE, block_of, testable
from postproc.gap.robot_model import effect_of
from postproc.units import MM

POWER = 0.9
"""Share of draws that have to be told."""
LARGEST = 10.0 * MM
"""Sizes above are not looked at: a plan that needs them does not show the effect."""
_DRAWS = 60
_SMALLEST = 1e-7
_SEED = 23
_WINS = 0.7
"""Share of the parts left out that a named effect has to help on."""
_CLASS_SIZE = 3.0
"""Size of the prior of a class, in noise."""


@dataclass(frozen=True, slots=True)
class Told:
    """Smallest size, 3D rms over the readings [m], that is told; NaN if none is.

    usual: 3D rms [m] of what is usual; rival: what it is told from, "" for noise.
    """

    name: str
    smallest: float
    usual: float
    rival: str = ""

    @property
    def is_seldom_told(self) -> bool:
        """Whether the usual size does not suffice."""
        return not self.smallest <= self.usual


@dataclass(frozen=True, slots=True)
class Outlook:
    """What a plan tells: effects, classes of what no effect explains, pairs that stay one set."""

    sigma: float
    effects: tuple[Told, ...]
    classes: tuple[Told, ...]
    twins: tuple[Told, ...]
    not_testable: Mapping[str, tuple[str, ...]]

    def entry(self) -> dict[str, Any]:
        """Return the entry of the document, file units."""
        return {
            "sigma_mm": round(self.sigma / MM, 5),
            "power": POWER,
            "effects": [_entry(one, "name") for one in self.effects],
            "classes": [_entry(one, "class") for one in self.classes],
            "cannot_separate": [
                {
                    "effects": sorted((one.name, one.rival)),
                    "from_mm": _entry(one, "name")["smallest_mm"],
                }
                for one in self.twins
            ],
            "not_testable": [
                {"name": name, "needs": list(needs)} for name, needs in self.not_testable.items()
            ],
        }


def _entry(one: Told, key: str) -> dict[str, Any]:
    found: dict[str, Any] = {key: one.name}
    found["smallest_mm"] = round(one.smallest / MM, 4) if np.isfinite(one.smallest) else None
    if np.isfinite(one.usual):
        found["usual_mm"] = round(one.usual / MM, 4)
    return found


def outlook(samples: Samples, sigma: float) -> Outlook:
    """Return what readings to come will be able to tell.

    Args:
        samples: rows of the plan, with the columns that will be logged.
        sigma: noise of a reading per axis [m].
    """
    effects, missing = testable(samples, {}, registered=True, several=False)
    parts = split(samples, None)
    # postures that are all alike are one cluster, and all sealed
    open_ = np.flatnonzero(~parts.sealed | bool(parts.sealed.all()))
    samples = samples.rows(open_)
    labels = tuple(np.repeat(label[open_], 3) for label in (parts.fold, parts.stretch))
    known = [e for e in effects if e.kind is Kind.MACHINE and not e.on_demand]
    frames = np.concatenate([_columns(effect_of(n), samples) for n in _frames()], axis=1)
    frames *= WIDE / sigma
    views = [_View.of(e.name, _columns(e, samples) / sigma, frames, len(samples)) for e in known]
    classes: dict[str, list[Told]] = {}
    for group in groups_of(samples, ()):
        told = _class_told(group, frames, sigma, len(samples))
        classes.setdefault(group.kind, []).append(told)
    pairs = [
        max((_told_from(a, b, sigma), _told_from(b, a, sigma)), key=_difficulty)
        for a, b in itertools.combinations(views, 2)
    ]
    return Outlook(
        sigma,
        tuple(
            sorted(
                (_named(v, sigma, labels) for v in views), key=lambda t: (_difficulty(t), t.name)
            )
        ),
        tuple(max(found, key=_difficulty) for _, found in sorted(classes.items())),
        tuple(sorted((p for p in pairs if p.is_seldom_told), key=lambda t: (t.name, t.rival))),
        missing,
    )


def _frames() -> Sequence[str]:
    return [name for name in registration_effects() if not effect_of(name).of_several]


def _columns(effect: Effect, samples: Samples) -> FloatArray:
    """Return the columns (3n, p) of an effect [m per usual size]."""
    X = block_of(effect, samples, effect.prepare(samples)).X
    return np.asarray(X.reshape(3 * len(samples), -1))


def _difficulty(told: Told) -> float:
    return told.smallest if np.isfinite(told.smallest) else np.inf


@dataclass(frozen=True, slots=True)
class _View:
    """An effect as the readings show it beside free frames.

    X: (3n, p) in sigma; F: (3n, f) the same of the frames; G: (p, p) products of what the frames
    leave; theta: (d, p) draws of unit size, 3D rms of one metre; usual: [sigma].
    """

    name: str
    X: FloatArray
    F: FloatArray
    G: FloatArray
    theta: FloatArray
    usual: float

    @classmethod
    def of(cls, name: str, X: FloatArray, F: FloatArray, rows: int) -> _View:
        """Return the view of columns (3n, p) in sigma."""
        rng = np.random.default_rng(_SEED)
        theta = rng.normal(size=(_DRAWS, X.shape[1]))
        size = np.sqrt(np.sum((theta @ X.T) ** 2, axis=1) / rows)
        G = X.T @ _without(F, X)
        return cls(name, X, F, G, theta / size[:, None], float(np.median(size)))

    def noise(self) -> FloatArray:
        """Return draws (d, p) of what the noise adds to the products with the gap."""
        rng = np.random.default_rng(_SEED + 1)
        values, vectors = np.linalg.eigh(self.G)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(rng.normal(size=(_DRAWS, len(self.G))) @ root.T)


def _without(F: FloatArray, X: FloatArray) -> FloatArray:
    """Return columns (3n, p) without what free frames take of them."""
    taken = np.linalg.solve(F.T @ F + np.eye(F.shape[1]), F.T @ X)
    return np.asarray(X - F @ taken)


def _evidence(G: FloatArray, b: FloatArray) -> FloatArray:
    """Return the evidence (d,) [nats] of columns with products G, and b (d, p) with the gap."""
    H = G + np.eye(len(G))
    return np.asarray(
        0.5 * np.sum(b * np.linalg.solve(H, b.T).T, axis=1) - 0.5 * np.linalg.slogdet(H)[1]
    )


def _named(view: _View, sigma: float, labels: Sequence[IntArray]) -> Told:
    """Return the size from which an effect is named; labels (3n,) of parts that are left out."""
    X = _without(view.F, view.X)
    noise = np.random.default_rng(_SEED + 1).normal(size=(_DRAWS, len(X)))
    noise = _without(view.F, noise.T).T
    divisions = [
        [(X[label == k].T @ X[label == k], noise[:, label == k] @ X[label == k]) for k in names]
        for label in labels
        for names in [np.unique(label)]
    ]
    G, whole = X.T @ X, noise @ X

    def helps(parts: list[tuple[FloatArray, FloatArray]], c: float) -> BoolArray:
        won = np.zeros(_DRAWS)
        for own, rest in parts:
            b = c * view.theta @ own + rest
            left_out = c * view.theta @ (G - own) + whole - rest
            fitted = np.linalg.solve(G - own + np.eye(len(G)), left_out.T).T
            won += np.sum(fitted * (2.0 * b - fitted @ own), axis=1) > 0.0
        return np.asarray(won >= _WINS * len(parts))

    def is_told(c: float) -> BoolArray:
        seen = _evidence(G, c * view.theta @ G + whole) >= DECISIVE + PRIOR_LIBRARY
        return np.asarray(np.logical_and.reduce([seen, *(helps(p, c) for p in divisions)]))

    return Told(view.name, _smallest(is_told, sigma), view.usual * sigma)


def _told(view: _View, sigma: float, least: float = DECISIVE + PRIOR_LIBRARY) -> Told:
    signal, noise = view.theta @ view.G, view.noise()
    found = _smallest(lambda c: np.asarray(_evidence(view.G, c * signal + noise) >= least), sigma)
    return Told(view.name, found, view.usual * sigma)


def _told_from(true: _View, rival: _View, sigma: float) -> Told:
    """Return the size from which an effect is told from another that may stand for it."""
    both = _View.of("", np.concatenate([true.X, rival.X], axis=1), true.F, 1)
    p = len(true.G)
    signal, noise = true.theta @ both.G[:p], both.noise()

    def won(c: float) -> BoolArray:
        b = c * signal + noise
        ahead = _evidence(true.G, b[:, :p]) - _evidence(rival.G, b[:, p:])
        return np.asarray(ahead >= CONFOUNDED)

    return Told(true.name, _smallest(won, sigma), true.usual * sigma, rival.name)


def _class_told(group: Group, frames: FloatArray, sigma: float, rows: int) -> Told:
    X = group.X.reshape(3 * rows, -1) * _CLASS_SIZE
    told = _told(_View.of(group.kind, X, frames, rows), sigma, SURE + group.price)
    return Told(group.kind, told.smallest, float("nan"))


def _smallest(is_told: Callable[[float], BoolArray], sigma: float) -> float:
    """Return the smallest size [m] from which enough draws are told, NaN beyond the largest."""
    low, high = _SMALLEST, LARGEST
    if float(np.mean(is_told(high / sigma))) < POWER:
        return float("nan")
    while high > 1.01 * low:
        middle = float(np.sqrt(low * high))
        if float(np.mean(is_told(middle / sigma))) >= POWER:
            high = middle
        else:
            low = middle
    return high
