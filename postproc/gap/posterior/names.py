"""Names and what speaks for them, read off the posterior."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from postproc.gap.effect import Effect
from postproc.gap.posterior.chosen import Posterior
from postproc.gap.posterior.evidence import Optimum
from postproc.gap.posterior.prior import Sort
from postproc.gap.posterior.search import Subset
from postproc.gap.robot_model import effect_of
from postproc.records import dataclass

CLOSE = 8.0
"""Nats behind the best set within which another set stands for it: two temperatures."""


@dataclass(frozen=True, slots=True)
class Name:
    """An effect in the most probable set.

    is_half: rows that were not fitted do not confirm it by more than their error;
    keys: of its candidates there; gain: nats lost without it; unique: 3D rms [m] that only it
    explains; probability: that it is there; confounded: names whose sets do about as well;
    rival: one of them that is a class that no effect has the formula of, in words; is_instruments:
    whether one of them is of the measuring device.
    """

    name: str
    keys: Subset
    gain: float
    unique: float
    probability: float
    confounded: tuple[str, ...] = ()
    rival: str = ""
    is_half: bool = False
    is_instruments: bool = False

    @property
    def is_withheld(self) -> bool:
        """Whether no model holds it unasked: the measuring device may have caused the same."""
        return self.is_instruments and self.effect.is_arms

    @property
    def effect(self) -> Effect:
        """The effect."""
        return effect_of(self.name)


def names_of(of: Posterior, at: Optimum) -> tuple[Name, ...]:
    """Return the causes of the most probable set, those first that explain most alone."""
    search = of.search
    inclusion = search.inclusion()
    by_name: dict[str, list[str]] = {}
    for key in at.keys:
        if of.candidate(key).sort is Sort.CAUSE:
            by_name.setdefault(of.candidate(key).name, []).append(key)
    best = tuple(k for k in at.keys if k not in search.always)
    found = []
    for name, keys in by_name.items():
        rest = tuple(k for k in best if k not in keys)
        search.optimum(rest, at)
        gain = search.worth(at) - search.worth(search.optimum(rest))
        confounded, rival, is_instruments = _standing_for(of, best, name)
        found.append(
            Name(
                name,
                tuple(keys),
                gain,
                unique_part(of, at, keys),
                max(inclusion.get(k, 0.0) for k in keys),
                confounded,
                rival,
                is_instruments=is_instruments,
            )
        )
    return tuple(sorted(found, key=lambda n: (-n.unique, n.name)))


def unique_part(of: Posterior, at: Optimum, keys: Iterable[str]) -> float:
    """Return what only some candidates of a set explain, 3D rms [m]; scales stay."""
    equations = of.search.equations
    _, H, b = equations.among(at.keys)
    stays = np.ones(len(b), dtype=bool)
    for key in keys:
        stays[at.part(equations, key)] = False
    H, b, D = H[np.ix_(stays, stays)], b[stays], at.deviation[stays]
    inverse = np.linalg.inv(H + at.sigma**2 * np.diag(D**-2))
    theta = inverse @ b
    left = equations.square - float(theta @ (2.0 * b - H @ theta))
    free = equations.readings - float(np.trace(inverse @ H))
    more = max(free - at.free, 0.0) * at.sigma**2
    return float(np.sqrt(max(left - at.left - more, 0.0) / max(len(of.at.z), 1)))


def _standing_for(of: Posterior, best: Subset, name: str) -> tuple[tuple[str, ...], str, bool]:
    """Return names that stand for one, a class that does, and whether one is a device."""
    search = of.search
    top = search.score(best) if best in search.found else search.score(search.best)
    rest = {of.candidate(k).name for k in best} - {name}
    names: dict[str, float] = {}
    for subset in search.found:
        held = {of.candidate(k).name for k in subset}
        behind = top - search.score(subset)
        if name in held or behind > CLOSE or not rest <= held | {name}:
            continue
        for key in subset:
            other = of.candidate(key)
            if other.name not in rest and other.sort is not Sort.WANDER:
                names[key] = min(names.get(key, np.inf), behind)
    known = sorted({of.candidate(k).name for k in names if of.candidate(k).effect is not None})
    classes = [of.candidate(k).group for k in sorted(names, key=lambda k: (names[k], k))]
    words = next((f"{g.kind} ({g.of}: {g.shape})" for g in classes if g is not None), "")
    return tuple(known), words, any(of.candidate(k).is_device for k in names)
