"""What a campaign will be able to tell, before anything of it is measured.

For each effect, numbers are drawn as arms have them and scaled to a size; readings of the plan with
noise are then weighed as a diagnosis would weigh them beside a free registration, without the rows
that it seals: the effect must be called for, be large enough for a name, and beat every other
effect, every two others, and whatever it may be mistaken for. All of this is quadratic in the size.
The smallest size is told at which nine of ten campaigns name the effect; and for each pair of
effects the size from which the true one beats the other in as many.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.data import Samples, split
from postproc.gap.effect import Effect, Kind, Setting, registration_effects
from postproc.gap.fit import testable
from postproc.gap.posterior import (
    CLOSE,
    DECISIVE,
    SMALLEST,
    Candidate,
    groups_of,
    of_effect,
    of_group,
)
from postproc.gap.robot_model import effect_of
from postproc.records import dataclass
from postproc.units import MM

POWER = 0.9
"""Share of campaigns that are to tell what is promised."""
_TOLD = 0.98
"""Share of draws that have to: a noise that is itself estimated, and names in the company of others
cost the rest."""
LARGEST = 10.0 * MM
"""Sizes above are not looked at: a plan that needs them does not show the effect."""
_DRAWS = 120
_FEWEST = 8
"""Draws of each setting of an effect."""
_NEAREST = 8
"""Candidates of which every two are tried in the place of an effect."""
_NOTHING = 1e-15
_SMALLEST = 1e-7
_SEED = 23


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

    @property
    def can_tell(self) -> tuple[str, ...]:
        """Effects that are named where they are of usual size."""
        return tuple(one.name for one in self.effects if not one.is_seldom_told)

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
    sealed = split(samples, None).sealed
    # postures that are all alike are one cluster, and all sealed
    samples = samples.rows(np.flatnonzero(~sealed | bool(sealed.all())))
    free = [effect_of(name) for name in registration_effects()]
    frames = [_of(e, samples)[0] for e in free if not e.of_several]
    F = np.concatenate([c.X.reshape(3 * len(samples), -1) for c in frames], axis=1)
    bench = _Bench.of(F / sigma, sigma)
    known = [e for e in effects if e.kind is not Kind.REGISTRATION and not e.on_demand]
    machine = [e for e in known if e.kind is Kind.MACHINE]
    of_name = {e.name: [_Seen.of(c, bench) for c in _of(e, samples)] for e in known}
    rivals = _Rivals.of([one for e in known if not e.periodic for one in of_name[e.name]])
    named = [_named(of_name[e.name], rivals, bench) for e in machine]
    whole = [_Seen.of(of_effect(e, samples, e.prepare(samples)), bench) for e in machine]
    pairs = [
        max((_told_from(*two, bench) for two in (pair, pair[::-1])), key=_difficulty)
        for pair in itertools.combinations(whole, 2)
    ]
    classes: dict[str, list[Told]] = {}
    for group in groups_of(samples):
        seen = group.X.shape[2] > 0
        size = _called(_Seen.of(of_group(group), bench), bench) if seen else float("nan")
        classes.setdefault(group.kind, []).append(Told(group.kind, size, float("nan")))
    return Outlook(
        sigma,
        tuple(sorted(named, key=lambda t: (_difficulty(t), t.name))),
        tuple(max(found, key=_difficulty) for _, found in sorted(classes.items())),
        tuple(sorted((p for p in pairs if p.is_seldom_told), key=lambda t: (t.name, t.rival))),
        missing,
    )


def _of(effect: Effect, samples: Samples) -> list[Candidate]:
    """Return an effect in each setting that it may truly have: waves are those of two joints."""
    settings: Collection[Setting] = effect.variants(effect.prepare(samples)).values()
    if effect.periodic:
        pairs = itertools.combinations(range(1, 7), 2)
        settings = [{"waves": ((a, 2.0), (b, 3.0))} for a, b in pairs]
    always = effect.kind is Kind.REGISTRATION
    return [of_effect(effect, samples, setting, always=always) for setting in settings]


def _difficulty(told: Told) -> float:
    return told.smallest if np.isfinite(told.smallest) else np.inf


@dataclass(frozen=True, slots=True)
class _Bench:
    """Readings in units of their noise, beside free frames.

    sigma: [m]; rows: how many; F: (3n, f) columns of the frames; inverse: (f, f) of their products
    with the prior; noise: (d, 3n) draws.
    """

    sigma: float
    rows: int
    F: FloatArray
    inverse: FloatArray
    noise: FloatArray

    @classmethod
    def of(cls, F: FloatArray, sigma: float) -> _Bench:
        """Return it for frames (3n, f)."""
        inverse = np.asarray(np.linalg.inv(F.T @ F + np.eye(F.shape[1])))
        drawn = np.random.default_rng(_SEED + 1).normal(size=(_DRAWS, len(F)))
        return cls(sigma, len(F) // 3, F, inverse, drawn)

    def left(self, X: FloatArray) -> FloatArray:
        """Return what the frames leave of columns (3n, p)."""
        return np.asarray(X - self.F @ (self.inverse @ (self.F.T @ X)))


@dataclass(frozen=True, slots=True)
class _Draws:
    """Gaps of one cause in units of the noise.

    signal: (d, 3n) per metre of 3D rms; noise: (d, 3n); usual: (d,) 3D rms [m].
    """

    signal: FloatArray
    noise: FloatArray
    usual: FloatArray

    @classmethod
    def of(cls, X: FloatArray, theta: FloatArray, bench: _Bench) -> _Draws:
        """Return those of columns (3n, p) and numbers (d, p)."""
        size = np.sqrt(np.sum((theta @ X.T) ** 2, axis=1) / bench.rows) * bench.sigma
        signal = (theta / np.maximum(size, _NOTHING)[:, None]) @ X.T
        return cls(signal, bench.noise[: len(theta)], size)


@dataclass(frozen=True, slots=True)
class _Quadratic:
    """Values over draws that are quadratic in the size of the gap; c: (3, d) or (3, m, d)."""

    c: FloatArray

    @classmethod
    def of(cls, signal: FloatArray, noise: FloatArray, M: FloatArray) -> _Quadratic:
        """Return that of a symmetric form (k, k) of signal (d, k) per size and noise (d, k)."""
        once, twice = signal @ M, noise @ M
        terms = [np.sum(noise * twice, axis=1), 2.0 * np.sum(noise * once, axis=1)]
        return cls(np.stack([*terms, np.sum(signal * once, axis=1)]))

    def at(self, size: float) -> FloatArray:
        """Return the values (d,) or (m, d) at a size [m]."""
        return np.asarray(self.c[0] + size * (self.c[1] + size * self.c[2]))


@dataclass(frozen=True, slots=True)
class _Seen:
    """A candidate as readings show it beside free frames.

    X, P: (3n, p) its columns, with and without the frames, in noise; G: (p, p) products of the
    latter; inverse: with prior.
    """

    candidate: Candidate
    X: FloatArray
    P: FloatArray
    G: FloatArray
    inverse: FloatArray

    @classmethod
    def of(cls, candidate: Candidate, bench: _Bench) -> _Seen:
        """Return the view of a candidate."""
        X = candidate.X.reshape(3 * bench.rows, -1) / bench.sigma
        P = bench.left(X)
        G = P.T @ P
        return cls(candidate, X, P, G, np.asarray(np.linalg.inv(G + np.eye(len(G)))))

    @property
    def name(self) -> str:
        """Of the effect or class."""
        return self.candidate.name

    def draws(self, count: int, bench: _Bench) -> _Draws:
        """Return gaps that this is the cause of, by its numbers as arms have them."""
        theta = np.random.default_rng(_SEED).normal(size=(count, self.X.shape[1]))
        of = self.candidate
        if of.effect is not None and of.root is not None and of.lower is not None:
            theta = of.effect.drawn(theta)
            low = of.lower / np.diag(of.root)
            theta = np.where(theta < low, 2.0 * low - theta, theta)
        return _Draws.of(self.X, theta, bench)

    def evidence(self, draws: _Draws) -> _Quadratic:
        """Return its evidence [nats] for some gaps."""
        found = _Quadratic.of(draws.signal @ self.P, draws.noise @ self.P, 0.5 * self.inverse)
        found.c[0] += 0.5 * float(np.linalg.slogdet(self.inverse)[1])
        return found

    def unique(self, draws: _Draws) -> _Quadratic:
        """Return the squared 3D rms [sigma] that it explains beyond what its numbers take."""
        M = 2.0 * self.inverse - self.inverse @ self.G @ self.inverse
        found = _Quadratic.of(draws.signal @ self.P, draws.noise @ self.P, M)
        found.c[0] -= len(self.G) - float(np.trace(self.inverse))
        return _Quadratic(found.c * 3.0 / len(self.P))


@dataclass(frozen=True, slots=True)
class _Rivals:
    """All candidates, their columns P (3n, k) side by side from ``start`` on, products G (k, k)."""

    seen: Sequence[_Seen]
    P: FloatArray
    G: FloatArray
    start: IntArray

    @classmethod
    def of(cls, seen: Sequence[_Seen]) -> _Rivals:
        """Return them."""
        P = np.concatenate([one.P for one in seen], axis=1)
        start = np.cumsum([0, *(one.P.shape[1] for one in seen)]).astype(np.int32)
        return cls(seen, P, P.T @ P, start)

    def behind(self, truth: _Seen, own: _Quadratic, draws: _Draws) -> _Quadratic:
        """Return by how much (m, d) others fail to take a name: each one, and two of the nearest.

        The nearest are those that explain most of the gaps.
        """
        price = -truth.candidate.odds
        signal, noise = draws.signal @ self.P, draws.noise @ self.P
        found = []

        def tried(*which: int) -> float:
            odds = sum(self.seen[k].candidate.odds for k in which)
            at = np.concatenate([np.arange(self.start[k], self.start[k + 1]) for k in which])
            inverse = np.asarray(np.linalg.inv(self.G[np.ix_(at, at)] + np.eye(len(at))))
            other = _Quadratic.of(signal[:, at], noise[:, at], 0.5 * inverse)
            ahead = own.c - other.c
            ahead[0] -= 0.5 * float(np.linalg.slogdet(inverse)[1]) + price
            ahead[0] += (DECISIVE if len(which) > 1 else 0.0) - odds
            found.append(ahead)
            return float(np.mean(other.c[2]))

        names = [one.name for one in self.seen]
        each = {k: tried(k) for k, name in enumerate(names) if name != truth.name}
        for a, b in itertools.combinations(sorted(each, key=each.__getitem__)[-_NEAREST:], 2):
            if names[a] != names[b]:
                tried(a, b)
        return _Quadratic(np.stack(found, axis=1))


def _named(truths: Sequence[_Seen], rivals: _Rivals, bench: _Bench) -> Told:
    """Return the size from which an effect, in each of its settings, is named by a diagnosis."""
    each = max(_DRAWS // len(truths), _FEWEST)
    drawn = [truth.draws(each, bench) for truth in truths]
    rules = [_rule(t, d, rivals) for t, d in zip(truths, drawn, strict=True)]

    def is_told(size: float) -> BoolArray:
        return np.concatenate([rule(size) for rule in rules])

    usual = float(np.median(np.concatenate([d.usual for d in drawn])))
    return Told(truths[0].name, _smallest(is_told), usual)


def _rule(truth: _Seen, draws: _Draws, rivals: _Rivals) -> Callable[[float], BoolArray]:
    """Return what says for a size which draws (d,) of a cause are named."""
    price = -truth.candidate.odds
    own, unique = truth.evidence(draws), truth.unique(draws)
    beside = rivals.behind(truth, own, draws)

    def is_told(size: float) -> BoolArray:
        told = own.at(size) >= DECISIVE + price
        told &= unique.at(size) >= SMALLEST**2
        return np.asarray(told & np.all(beside.at(size) > 0.0, axis=0))

    return is_told


def _told_from(true: _Seen, rival: _Seen, bench: _Bench) -> Told:
    """Return the size from which an effect is told from another that may stand for it."""
    draws = true.draws(_DRAWS, bench)
    ahead = _Quadratic(true.evidence(draws).c - rival.evidence(draws).c)
    smallest = _smallest(lambda size: np.asarray(ahead.at(size) >= CLOSE))
    return Told(true.name, smallest, float(np.median(draws.usual)), rival.name)


def _called(seen: _Seen, bench: _Bench) -> float:
    """Return the size [m] from which a candidate is called for, beside the frames alone."""
    gain = seen.evidence(seen.draws(_DRAWS, bench))
    return _smallest(lambda size: np.asarray(gain.at(size) >= DECISIVE - seen.candidate.odds))


def _smallest(is_told: Callable[[float], BoolArray]) -> float:
    """Return the smallest size [m] from which enough draws are told, NaN beyond the largest."""
    low, high = _SMALLEST, LARGEST
    if float(np.mean(is_told(high))) < _TOLD:
        return float("nan")
    while high > 1.01 * low:
        middle = float(np.sqrt(low * high))
        if float(np.mean(is_told(middle))) >= _TOLD:
            high = middle
        else:
            low = middle
    return high
