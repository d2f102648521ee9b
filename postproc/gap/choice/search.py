"""Which subset of effects: exhaustive up to a size, then by exchanges, judged by evidence."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from postproc.gap.fit import Block, NormalEquations, Subset
from postproc.records import dataclass

PRIOR_LIBRARY = 3.0
"""Price of naming one more effect, in nats: 1 in 20 effects is present a priori."""
PRIOR_RARE = 20.0
"""The same of an effect that is seldom the cause: a flaw of a common one's formula is likelier."""
_PER_WAVE = 6.6
"""Log of the joints and orders among which each wave is sought."""
PRIOR_ALTERNATIVE = 6.0
"""Price of calling for a cause outside of the library."""
DECISIVE = 6.0
"""Nats by which a model must beat another (odds 400 to 1)."""
TEMPERATURE = 10.0
"""What differences of score are divided by before they count as odds. Evidence takes every formula
for exact, and none is: of four names that led by less than ten nats in blind campaigns two were
wrong, of sixty-two that led by more none. What leads no cause at all by less is no finding."""
LARGEST = 10
"""Blocks in a subset; data that call for more are not explained by the library."""
_ROWS_EACH = 8
"""Rows that each further block needs: a choice among many takes more than a fit."""
FEW = LARGEST * _ROWS_EACH
"""Rows below which a subset may not be as large as what is there."""
_MERGES = 3


@dataclass(slots=True)
class Search:
    """Subsets visited and their scores in nats (evidence minus the price of the names).

    ``plain``: the equations without a smooth rest, by which sizes are told.
    """

    equations: NormalEquations
    always: Subset
    largest: int
    names: dict[str, str]
    price: dict[str, float]
    scores: dict[Subset, float]
    plain: NormalEquations | None = None

    @property
    def best(self) -> Subset:
        """The subset of fewest effects among the most probable, always-on blocks left out."""
        top = max(self.scores.values())
        close = [s for s, score in self.scores.items() if score > top - DECISIVE]
        return min(close, key=lambda s: (len(s), -self.scores[s], s))

    def score(self, subset: Iterable[str]) -> float:
        """Return (and keep) the score of a subset."""
        key = tuple(sorted(subset))
        if key not in self.scores:
            evidence = self.equations.evidence((*self.always, *key))
            self.scores[key] = evidence - sum(self.price[k] for k in key)
        return self.scores[key]

    def with_candidate(self, block: Block) -> Search:
        """Return the same search with one more block that it may score."""
        return replace(
            self,
            scores=dict(self.scores),
            names=self.names | {block.key: block.name},
            price=self.price | {block.key: price_of(block)},
        )

    def is_admissible(self, subset: Iterable[str]) -> bool:
        """Return whether no effect is there in two variants, and the rows suffice for so many."""
        names = [self.names[k] for k in subset]
        return len(set(names)) == len(names) <= self.largest

    def inclusion(self) -> dict[str, float]:
        """Return the probability of each effect over the subsets visited, tempered."""
        keys = list(self.scores)
        values = np.array([self.scores[k] for k in keys])
        weight = np.exp((values - values.max()) / TEMPERATURE)
        weight /= weight.sum()
        found = dict.fromkeys(self.names.values(), 0.0)
        for subset, share in zip(keys, weight, strict=True):
            for key in subset:
                found[self.names[key]] += float(share)
        return found


def price_of(block: Block) -> float:
    """Return the price [nats] of calling for a block."""
    if block.is_alternative:
        return PRIOR_ALTERNATIVE
    return (PRIOR_RARE if block.effect.is_rare else PRIOR_LIBRARY) + searched(block)


def searched(block: Block) -> float:
    """Return the price [nats] of the search for the waves of a block, each among hundreds."""
    return _PER_WAVE * len(block.setting["waves"]) if block.effect.periodic else 0.0


def search(
    equations: NormalEquations,
    always: Sequence[str] = (),
    exhaustive: int = 3,
    excluded: Iterable[str] = (),
    known: Mapping[Subset, float] | None = None,
    plain: NormalEquations | None = None,
) -> Search:
    """Score subsets of the candidates.

    All subsets up to ``exhaustive`` blocks are scored; from the best of them one block is added,
    dropped or exchanged for another as long as the score rises.

    Args:
        equations: normal equations of all blocks.
        always: keys of blocks that are in every subset (registration).
        exhaustive: largest size of which all subsets are tried.
        excluded: keys that may not be used.
        known: scores of an earlier search of the same equations.
        plain: the equations without a smooth rest.
    """
    out = set(always) | set(excluded) | set(equations.nuisance)
    blocks = [block for block in equations.blocks if block.key not in out]
    names = {block.key: block.name for block in blocks}
    most = int(np.clip(equations.rows // _ROWS_EACH, 1, LARGEST))
    state = Search(equations, tuple(always), most, {}, {}, {}, plain)
    for block in blocks:
        state = state.with_candidate(block)
    keys = sorted(names)
    state.scores |= {s: v for s, v in (known or {}).items() if out.isdisjoint(s)}
    exhaustive = min(exhaustive, most)
    for size in range(exhaustive + 1):
        for subset in itertools.combinations(keys, size):
            if state.is_admissible(subset):
                state.score(subset)
    starts = sorted(state.scores, key=lambda s: -state.scores[s])[:6]
    starts += _best_of_size(state, range(1, exhaustive + 1))
    for start in dict.fromkeys(starts):
        _improved(state, start, keys)
    for _ in range(_MERGES):
        here = max(state.scores, key=lambda s: (state.scores[s], s))
        around = [s for s in (*_merged(here, keys), *_parted(here, keys)) if state.is_admissible(s)]
        better = max(around, key=state.score, default=here)
        if state.score(better) <= state.score(here) + 1e-9:
            break
        _improved(state, better, keys)
    return state


def _best_of_size(state: Search, sizes: Iterable[int]) -> list[Subset]:
    found = []
    for size in sizes:
        of_size = [s for s in state.scores if len(s) == size]
        if of_size:
            found.append(max(of_size, key=lambda s: state.scores[s]))
    return found


def _improved(state: Search, start: Subset, keys: Sequence[str], steps: int = 30) -> Subset:
    """Add, drop or exchange one block at a time while it helps; return where that ends."""
    here = start
    for _ in range(steps):
        around = list(_neighbours(here, keys))
        best = max((s for s in around if state.is_admissible(s)), key=state.score, default=here)
        if state.score(best) <= state.score(here) + 1e-9:
            return here
        here = best
    return here


def _neighbours(subset: Subset, keys: Sequence[str]) -> Iterable[Subset]:
    inside = set(subset)
    outside = [key for key in keys if key not in inside]
    for key in outside if len(subset) < LARGEST else ():
        yield tuple(sorted(inside | {key}))
    for gone in subset:
        rest = inside - {gone}
        yield tuple(sorted(rest))
        for key in outside:
            yield tuple(sorted(rest | {key}))


def _merged(subset: Subset, keys: Sequence[str]) -> Iterable[Subset]:
    """Yield the subsets with one block in place of two: two can imitate what one explains."""
    for pair in itertools.combinations(subset, 2):
        rest = set(subset) - set(pair)
        for key in keys:
            if key not in subset:
                yield tuple(sorted(rest | {key}))


def _parted(subset: Subset, keys: Sequence[str]) -> Iterable[Subset]:
    """Yield the subsets with two blocks in place of one: a wide one can imitate two causes."""
    outside = [key for key in keys if key not in subset]
    for gone in subset:
        rest = set(subset) - {gone}
        for pair in itertools.combinations(outside, 2):
            yield tuple(sorted(rest | set(pair)))
