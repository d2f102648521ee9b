"""What a campaign will be able to tell, before anything of it is measured.

For each effect, numbers are drawn as arms have them and scaled to a size; readings of the plan with
noise are then weighed as a diagnosis would weigh them beside a free registration, without the rows
that it seals: the effect must be called for, be large enough for a name, help on places and times
that it was not fitted to, and beat every other effect, every two others, and whatever it may be
mistaken for. All of this is quadratic in the size. The smallest size is told at which nine of ten
campaigns name the effect; and for each pair of effects the size from which the true one beats the
other in as many.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.data import Samples, split
from postproc.gap.effect import Effect, Kind, Setting, registration_effects
from postproc.gap.fit import WIDE, Block, block_of, testable
from postproc.gap.posterior import CLOSE, DECISIVE, ODDS, SMALLEST, Group, groups_of, odds_of
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
_WON = 0.7
"""Share of the places that a name must make better."""
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
    parts = split(samples, None)
    # postures that are all alike are one cluster, and all sealed
    open_ = np.flatnonzero(~parts.sealed | bool(parts.sealed.all()))
    samples = samples.rows(open_)
    labels = tuple(np.repeat(label[open_], 3) for label in (parts.fold, parts.stretch))
    frames = [block_of(effect_of(n), samples, effect_of(n).prepare(samples)) for n in _frames()]
    F = np.concatenate([_columns(b, WIDE / sigma) for b in frames], axis=1)
    bench = _Bench.of(F, sigma, labels)
    known = [e for e in effects if e.kind is not Kind.REGISTRATION and not e.on_demand]
    machine = [e for e in known if e.kind is Kind.MACHINE]
    rivals = _Rivals.of(
        [
            _Seen.of(block, bench)
            for e in known
            if not e.periodic
            for block in _blocks(samples, e, e.variants(e.prepare(samples)).values())
        ]
    )
    named = [
        _named([_Seen.of(b, bench) for b in _blocks(samples, e, _kinds(e, samples))], rivals, bench)
        for e in machine
    ]
    whole = [_Seen.of(b, bench) for e in machine for b in _blocks(samples, e, [e.prepare(samples)])]
    pairs = [
        max((_told_from(*two, bench) for two in (pair, pair[::-1])), key=_difficulty)
        for pair in itertools.combinations(whole, 2)
    ]
    classes: dict[str, list[Told]] = {}
    for group in groups_of(samples):
        classes.setdefault(group.kind, []).append(_class_told(group, bench))
    return Outlook(
        sigma,
        tuple(sorted(named, key=lambda t: (_difficulty(t), t.name))),
        tuple(max(found, key=_difficulty) for _, found in sorted(classes.items())),
        tuple(sorted((p for p in pairs if p.is_seldom_told), key=lambda t: (t.name, t.rival))),
        missing,
    )


def _frames() -> Sequence[str]:
    return [name for name in registration_effects() if not effect_of(name).of_several]


def _blocks(samples: Samples, effect: Effect, settings: Iterable[Setting]) -> list[Block]:
    return [block_of(effect, samples, setting) for setting in settings]


def _kinds(effect: Effect, samples: Samples) -> Collection[Setting]:
    """Return the settings that an effect may truly have: waves are those of two joints."""
    if not effect.periodic:
        return effect.variants(effect.prepare(samples)).values()
    pairs = itertools.combinations(range(1, 7), 2)
    return [{"waves": ((a, 2.0), (b, 3.0))} for a, b in pairs]


def _difficulty(told: Told) -> float:
    return told.smallest if np.isfinite(told.smallest) else np.inf


@dataclass(frozen=True, slots=True)
class _Bench:
    """Readings in units of their noise, beside free frames.

    sigma: [m]; rows: how many; F: (3n, f) columns of the frames; inverse: (f, f) of their products
    with the prior; noise: (d, 3n) draws; parts: ways to part the readings, (3n,) each part.
    """

    sigma: float
    rows: int
    F: FloatArray
    inverse: FloatArray
    noise: FloatArray
    parts: tuple[tuple[BoolArray, ...], ...]

    @classmethod
    def of(cls, F: FloatArray, sigma: float, labels: Sequence[IntArray]) -> _Bench:
        """Return it for frames (3n, f) and labels (3n,) of parts that are left out in turn."""
        inverse = np.asarray(np.linalg.inv(F.T @ F + np.eye(F.shape[1])))
        drawn = np.random.default_rng(_SEED + 1).normal(size=(_DRAWS, len(F)))
        parts = tuple(tuple(label == k for k in np.unique(label)) for label in labels)
        return cls(sigma, len(F) // 3, F, inverse, drawn, parts)

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

    P: (3n, p) its columns without the frames, in noise; G: (p, p) products; inverse: with prior.
    """

    block: Block
    X: FloatArray
    P: FloatArray
    G: FloatArray
    inverse: FloatArray

    @classmethod
    def of(cls, block: Block, bench: _Bench) -> _Seen:
        """Return the view of a block."""
        X = _columns(block, 1.0 / bench.sigma)
        P = bench.left(X)
        G = P.T @ P
        return cls(block, X, P, G, np.asarray(np.linalg.inv(G + np.eye(len(G)))))

    def draws(self, count: int, bench: _Bench) -> _Draws:
        """Return gaps that this is the cause of, by its numbers as arms have them."""
        normal = np.random.default_rng(_SEED).normal(size=(count, self.X.shape[1]))
        theta = self.block.effect.drawn(normal)
        limits = [(p.lower / p.typical, p.upper / p.typical) for p in self.block.parameters]
        low, high = np.array(limits).reshape(-1, 2).T
        theta = np.where(theta < low, 2.0 * low - theta, theta)
        theta = np.where(theta > high, 2.0 * high - theta, theta)
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

    def helps(self, draws: _Draws, bench: _Bench, parts: Sequence[BoolArray]) -> list[_Quadratic]:
        """Return how far it lowers the misfit of each part when fitted to the others."""
        both = np.concatenate([bench.F, self.X], axis=1)
        return [
            _Quadratic(_carried(both, draws, part).c - _carried(bench.F, draws, part).c)
            for part in parts
        ]


def _carried(X: FloatArray, draws: _Draws, part: BoolArray) -> _Quadratic:
    """Return by how much columns (3n, p), fitted to the other readings, lower a part's misfit."""
    here, there = X[part], X[~part]
    G = here.T @ here
    K = np.asarray(np.linalg.inv(there.T @ there + np.eye(X.shape[1])))
    M = np.block([[-K @ G @ K, K], [K, np.zeros_like(K)]])
    gaps = (draws.signal, draws.noise)
    signal, noise = (np.hstack([gap[:, ~part] @ there, gap[:, part] @ here]) for gap in gaps)
    return _Quadratic.of(signal, noise, M)


def _columns(block: Block, scale: float) -> FloatArray:
    """Return the columns (3n, p) of a block, scaled."""
    return np.asarray(block.X.reshape(3 * len(block.X), -1) * scale)


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
        effect, price = truth.block.effect, -odds_of(truth.block.effect, truth.block.setting)
        signal, noise = draws.signal @ self.P, draws.noise @ self.P
        found = []

        def tried(*which: int) -> float:
            blocks = [self.seen[k].block for k in which]
            at = np.concatenate([np.arange(self.start[k], self.start[k + 1]) for k in which])
            inverse = np.asarray(np.linalg.inv(self.G[np.ix_(at, at)] + np.eye(len(at))))
            other = _Quadratic.of(signal[:, at], noise[:, at], 0.5 * inverse)
            ahead = own.c - other.c
            ahead[0] -= 0.5 * float(np.linalg.slogdet(inverse)[1]) + price
            ahead[0] += sum(-odds_of(block.effect, block.setting) for block in blocks) - (
                0.0 if len(blocks) == 1 else -DECISIVE
            )
            found.append(ahead)
            return float(np.mean(other.c[2]))

        names = [one.block.name for one in self.seen]
        each = {k: tried(k) for k, name in enumerate(names) if name != effect.name}
        for a, b in itertools.combinations(sorted(each, key=each.__getitem__)[-_NEAREST:], 2):
            if names[a] != names[b]:
                tried(a, b)
        return _Quadratic(np.stack(found, axis=1))


def _named(truths: Sequence[_Seen], rivals: _Rivals, bench: _Bench) -> Told:
    """Return the size from which an effect is named, by the rules of a diagnosis.

    Args:
        truths: the effect, in each setting that it may have.
        rivals: all candidates.
        bench: the readings.
    """
    each = max(_DRAWS // len(truths), _FEWEST)
    drawn = [truth.draws(each, bench) for truth in truths]
    rules = [_rule(t, d, rivals, bench) for t, d in zip(truths, drawn, strict=True)]

    def is_told(size: float) -> BoolArray:
        return np.concatenate([rule(size) for rule in rules])

    usual = float(np.median(np.concatenate([d.usual for d in drawn])))
    return Told(truths[0].block.name, _smallest(is_told), usual)


def _rule(
    truth: _Seen, draws: _Draws, rivals: _Rivals, bench: _Bench
) -> Callable[[float], BoolArray]:
    """Return what says for a size which draws (d,) of a cause are named."""
    price = -odds_of(truth.block.effect, truth.block.setting)
    own, unique = truth.evidence(draws), truth.unique(draws)
    divisions = [truth.helps(draws, bench, parts) for parts in bench.parts]
    beside = rivals.behind(truth, own, draws)

    def is_told(size: float) -> BoolArray:
        told = own.at(size) >= DECISIVE + price
        told &= unique.at(size) >= SMALLEST**2
        for gains in ([gain.at(size) for gain in division] for division in divisions):
            told &= np.mean(np.array(gains) > 0.0, axis=0) >= _WON
            told &= np.sum(gains, axis=0) > 0.0
        return np.asarray(told & np.all(beside.at(size) > 0.0, axis=0))

    return is_told


def _told_from(true: _Seen, rival: _Seen, bench: _Bench) -> Told:
    """Return the size from which an effect is told from another that may stand for it."""
    draws = true.draws(_DRAWS, bench)
    ahead = _Quadratic(true.evidence(draws).c - rival.evidence(draws).c)
    smallest = _smallest(lambda size: np.asarray(ahead.at(size) >= CLOSE))
    return Told(true.block.name, smallest, float(np.median(draws.usual)), rival.block.name)


def _class_told(group: Group, bench: _Bench) -> Told:
    X = group.X.reshape(3 * bench.rows, -1) * _CLASS_SIZE
    return Told(group.kind, _called(X, bench, DECISIVE - ODDS["class"] + group.price), float("nan"))


def _called(X: FloatArray, bench: _Bench, least: float) -> float:
    """Return the size [m] from which columns (3n, p), in noise, bring so much evidence [nats]."""
    P = bench.left(X)
    theta = np.random.default_rng(_SEED).normal(size=(_DRAWS, X.shape[1]))
    draws = _Draws.of(X, theta, bench)
    H = P.T @ P + np.eye(X.shape[1])
    M = np.asarray(0.5 * np.linalg.inv(H))
    gain = _Quadratic.of(draws.signal @ P, draws.noise @ P, M)
    price = least + 0.5 * float(np.linalg.slogdet(H)[1])
    return _smallest(lambda size: np.asarray(gain.at(size) >= price))


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
