"""Who else could it be: causes outside of the library, and twins inside of it."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping
from dataclasses import replace

from postproc.gap.fit import CLEAR, SMALLEST_SUSPECT, Bench, Evidence, Search, Subset
from postproc.gap.robot_model import effect_of

TWIN = 15.0
"""Nats by which the formulas of two known causes are not exact enough to decide."""


def shadowed(
    bench: Bench,
    keys: Subset,
    suspects: Subset,
    evidence: Mapping[str, Evidence],
    refused: dict[str, str],
) -> Subset:
    """Return the keys without those that a suspect takes the name from."""
    kept = []
    for key in keys:
        effect = bench.block(key).effect
        name = effect.name
        rivals = [
            s
            for s in suspects
            if (other := bench.block(s).effect).is_mistaken_for(effect)
            and evidence[s].unique > other.prevails_from * evidence[key].unique
        ]
        if rivals:
            refused[name] = f"the rows follow {rivals[0]} more closely than this effect"
        else:
            kept.append(key)
    return tuple(kept)


def doubtful(
    bench: Bench,
    keys: Subset,
    suspects: Subset,
    evidence: dict[str, Evidence],
    refused: dict[str, str],
) -> tuple[Subset, Subset, Subset]:
    """Take the name from an effect that a cause outside of the library would replace as well.

    Where another effect of the library would do so too, the name stands, in that set. Where the
    effect is small, nothing is called in its place.

    Returns:
        keys that are named, suspects, and keys that stay without a name.
    """
    kept, called, silent = [], list(suspects), []
    for key in keys:
        name, item = bench.name(key), evidence[key]
        same = [effect_of(twin) for twin in item.twins]
        rivals = [e.name for e in same if e.is_mistaken_for(bench.block(key).effect)]
        if not rivals or not all(e.is_alternative for e in same):
            kept.append(key)
            continue
        refused[name] = f"the rows cannot tell it from {rivals[0]}, which is not a known cause"
        if item.unique < SMALLEST_SUSPECT * bench.sigma:
            silent.append(key)
            continue
        for rival in set(rivals) - set(called):
            called.append(rival)
            others = tuple(sorted({name, *item.twins} - {rival}))
            evidence[rival] = replace(item, twins=others)
    return tuple(kept), tuple(sorted(called)), tuple(silent)


def twins(
    bench: Bench, found: Search, best: Subset, key: str, barred: Collection[str]
) -> tuple[str, ...]:
    """Return the effects that would do as well in place of one: the set it belongs to.

    In its place one or two others may stand, or one other in place of it and a second chosen one.
    """
    chosen = {bench.name(k) for k in best}
    rest = tuple(k for k in best if k != key)
    others = [
        b.key
        for b in bench.blocks
        if b.key in found.names and b.name not in chosen and b.key not in barred
    ]
    here = found.score(best)
    same: set[str] = set()
    swaps: list[tuple[Subset, Subset]] = [((), (k,)) for k in others]
    swaps += [((gone,), (k,)) for gone in rest for k in others]
    swaps += [((), pair) for pair in itertools.combinations(others, 2)]
    for gone, more in swaps:
        names = {bench.name(k) for k in more}
        if len(more) == 2 and (same & names or len(names) < 2):
            continue
        known = not any(bench.block(k).suspect for k in more)
        least = here - (TWIN if known else CLEAR)
        if found.score((*(k for k in rest if k not in gone), *more)) > least:
            same |= names
    return tuple(sorted(same))
