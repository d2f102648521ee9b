"""Names against classes: what a class that is no cause explains in the place of a name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from postproc.gap.choice.classes import Bench, Group, weighted
from postproc.gap.choice.search import searched
from postproc.gap.choice.standing import Choice
from postproc.gap.fit import REST, Regression
from postproc.records import dataclass

INEXACT = 0.04
"""What the formula of an effect may leave against what it explains, as 3D rms: no formula is exact,
and that is no other cause."""
_AHEAD = 10.0
"""Nats by which a class beats the formula of an effect."""
_ENOUGH = 0.9
"""Share of what a class explains from which a formula with fewer numbers may be its cause: a class
takes the flaws of the others' formulas, too."""
_BESIDE = 30.0
"""Nats that a name must bring beside a large class that is left: three times what is said to be
clear, for the class is not exact either."""
_LARGE = 0.5
"""Size of a class that is left against what only a name explains, from which the name must hold
beside it."""


@dataclass(frozen=True, slots=True)
class Rival:
    """The class that explains most in the place of a name.

    group: the class; gain: evidence that it brings there [nats]; own: the same of the name.
    """

    group: Group
    gain: float
    own: float

    @property
    def is_ahead(self) -> bool:
        """Whether it explains more than the name, beyond what an inexact formula excuses."""
        return self.gain > self.own + _AHEAD and self.own < (1.0 - INEXACT**2) * self.gain

    @property
    def prevails(self) -> bool:
        """Whether it explains so much more that the name is not its cause."""
        return self.is_ahead and self.own < _ENOUGH * self.gain

    @property
    def words(self) -> str:
        """What it is."""
        return f"{self.group.kind} ({self.group.of}: {self.group.shape})"


def rivals(regression: Regression, named: Iterable[str], beside: Iterable[str]) -> dict[str, Rival]:
    """Return the class that explains most in the place of each of some named blocks.

    Only classes whose formula is that of no effect stand against them.

    Args:
        regression: rows and blocks.
        named: keys of the blocks to be judged.
        beside: keys of all blocks of the model.
    """
    named = tuple(named)
    if not named:
        return {}
    bench = Bench.of(regression, ())
    others = [k for k, group in enumerate(bench.groups) if group.is_rival]
    inside = {*regression.always, *beside}
    found = {}
    for key in named:
        context = bench.context(inside - {key})
        own = weighted(regression.block(key).X[bench.use], bench.weight)
        gain = context.gain(own, context.rest) - searched(regression.block(key))
        tried = bench.fitted(context, others)
        best = max(others, key=lambda k: tried[k].gain)
        found[key] = Rival(bench.groups[best], tried[best].gain, gain)
    return found


def beaten(regression: Regression, named: Iterable[str], beside: Iterable[str]) -> dict[str, str]:
    """Return the named blocks in whose place a class explains far more, and which.

    Where the likelihood holds a smooth rest, the names have stood against that already.

    Args:
        regression: rows and blocks.
        named: keys of the blocks to be judged.
        beside: keys of all blocks of the model.
    """
    if REST in regression.nuisance:
        return {}
    return {
        key: f"{rival.words} explains more in its place"
        for key, rival in rivals(regression, named, beside).items()
        if rival.prevails
    }


def doubted(regression: Regression, choice: Choice) -> Choice:
    """Return a choice whose names know of the class that explains more in their place."""
    found = rivals(regression, choice.adopted, choice.model)
    evidence = {
        key: replace(choice.evidence[key], rival=rival.words)
        for key, rival in found.items()
        if rival.is_ahead
    }
    return replace(choice, evidence={**choice.evidence, **evidence})


def displaced(
    regression: Regression, named: Mapping[str, float], beside: Iterable[str]
) -> dict[str, str]:
    """Return the named blocks that classes of what is left leave nothing to, and which.

    Only classes whose formula is that of no effect count, where they are large against the name.

    Args:
        regression: rows and blocks.
        named: what only each of the blocks to be judged explains [m], by key.
        beside: keys of all blocks of the model.
    """
    if not named:
        return {}
    bench = Bench.of(regression, ())
    inside = {*regression.always, *beside}
    left = [(k, fit) for k, fit in bench.left(inside) if bench.groups[k].is_rival]
    found: dict[str, str] = {}
    for key, unique in named.items():
        large = [(k, fit) for k, fit in left if fit.rms > _LARGE * unique]
        if not large:
            continue
        context = bench.context(inside - {key})
        for k, fit in large:
            context.extend(bench.columns(k) * fit.size)
        block = regression.block(key)
        own = weighted(block.X[bench.use], bench.weight)
        if context.gain(own, context.rest) - searched(block) < _BESIDE:
            group = bench.groups[large[0][0]]
            found[key] = f"{group.kind} ({group.of}: {group.shape}) explains the same"
    return found
