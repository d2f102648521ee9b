"""What else it could be: alternatives outside of the library, and confounded effects inside it."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping
from dataclasses import replace

from postproc.gap.choice.evidence import (
    SMALLEST_ALTERNATIVE,
    Evidence,
    absorbing,
    smallest_part,
)
from postproc.gap.choice.search import DECISIVE, PRIOR_LIBRARY, PRIOR_RARE, Search
from postproc.gap.choice.standing import Choice, Standing
from postproc.gap.fit import Regression, Subset
from postproc.gap.robot_model import effect_of

CONFOUNDED = 15.0
"""Nats by which the formulas of two known causes are not exact enough to decide."""
_ENOUGH = 0.9
"""Share of what two names bring together from which one other may be both: no formula is exact, and
a second name takes the flaws of the first one's."""


def overruled(regression: Regression, choice: Choice) -> Choice:
    """Return a choice without the names that an alternative of the model has a better claim to."""
    for key in choice.adopted:
        effect = regression.block(key).effect
        for name in choice.resembled:
            other, share = effect_of(name), choice.evidence[name].unique
            large = share > other.prevails_from * choice.evidence[key].unique
            if large and other.is_mistaken_for(effect):
                reason = f"the rows follow {name} more closely than this effect"
                choice = choice.moved([key], Standing.REJECTED, {effect.name: reason})
                break
    return choice


def replaceable(regression: Regression, choice: Choice) -> Choice:
    """Return a choice without the names of effects that an alternative would replace as well.

    Where another effect of the library would do so too, the name stands, in that set. Where the
    effect is small, nothing is called in its place. What describes the effect more closely is none:
    where it does no better than the effect, there is nothing to describe.
    """
    for key in sorted(choice.adopted):
        effect, item = regression.block(key).effect, choice.evidence[key]
        same = [effect_of(name) for name in item.confounded]
        rivals = [
            e.name for e in same if e.is_mistaken_for(effect) and effect.name not in e.refines
        ]
        if not rivals or not all(e.is_alternative for e in same):
            continue
        reason = f"the rows cannot tell it from {rivals[0]}, which is not a known cause"
        if item.unique < SMALLEST_ALTERNATIVE * regression.sigma:
            choice = choice.moved([key], Standing.UNNAMED, {effect.name: reason})
            continue
        choice = choice.moved([key], Standing.REJECTED, {effect.name: reason})
        called = set(rivals) - set(choice.resembled)
        evidence = {
            rival: replace(
                item, confounded=tuple(sorted({effect.name, *item.confounded} - {rival}))
            )
            for rival in called
        }
        choice = replace(choice, evidence={**choice.evidence, **evidence})
        choice = choice.moved(called, Standing.RESEMBLED, {})
    return choice


def confounded_with(
    regression: Regression, found: Search, best: Subset, key: str, excluded: Collection[str]
) -> tuple[str, ...]:
    """Return the effects that would do as well in place of one: the set it belongs to.

    In its place one or two others may stand, or one other in place of it and a second chosen one.
    """
    chosen = {regression.name(k) for k in best}
    rest = tuple(k for k in best if k != key)
    others = [
        b.key
        for b in regression.blocks
        if b.key in found.names and b.name not in chosen and b.key not in excluded
    ]
    here = found.score(best)
    same: set[str] = set()
    exchanges: list[tuple[Subset, Subset]] = [((), (k,)) for k in others]
    exchanges += [((gone,), (k,)) for gone in rest for k in others]
    exchanges += [((), pair) for pair in itertools.combinations(others, 2)]
    for gone, more in exchanges:
        names = {regression.name(k) for k in more}
        if len(more) == 2 and (same & names or len(names) < 2):
            continue
        known = not any(regression.block(k).is_alternative for k in more)
        # a rare cause is not called for a flaw of a common one, and may be it all the same
        seldom = sum(regression.block(k).effect.is_rare for k in more)
        least = here - (CONFOUNDED if known else DECISIVE) - seldom * (PRIOR_RARE - PRIOR_LIBRARY)
        if found.score((*(k for k in rest if k not in gone), *more)) > least:
            same |= names
    return tuple(sorted(same))


def taken_in_by(
    regression: Regression, best: Subset, evidence: Mapping[str, Evidence], key: str
) -> tuple[str, ...]:
    """Return the effects of a subset that leave nothing to one of them but what noise would hide.

    What both explain may be of either; that little alone does not decide.
    """
    if evidence[key].unique < smallest_part(regression, best, evidence, key):
        return absorbing(regression, best, key)
    return ()


def in_place_of_two(
    regression: Regression,
    found: Search,
    best: Subset,
    named: Collection[str],
    barred: Collection[str],
) -> dict[str, set[str]]:
    """Return the named blocks for which one other effect may stand, two of them at a time.

    It must bring nearly all that both do together, and more than either does. That it did not help
    beside the two is nothing against it: what it says was theirs already.

    Args:
        regression: blocks.
        found: the search, for its scores.
        best: the chosen subset.
        named: keys of it that carry a name.
        barred: keys that cannot be it.

    Returns:
        Names of such effects by key.
    """
    chosen = {regression.name(k) for k in best}
    others = [
        b
        for b in regression.blocks
        if not (b.is_alternative or b.effect.is_rare or b.effect.periodic)
        and b.key not in {*regression.always, *barred}
        and b.name not in chosen
    ]
    here = found.score(best)
    same: dict[str, set[str]] = {}
    for pair in itertools.combinations(sorted(named), 2):
        rest = tuple(k for k in best if k not in pair)
        without = found.score(rest)
        least = max(without + _ENOUGH * (here - without), *(found.score((*rest, k)) for k in pair))
        for other in others:
            if found.score((*rest, other.key)) > least:
                for key in pair:
                    same.setdefault(key, set()).add(other.name)
    return same
