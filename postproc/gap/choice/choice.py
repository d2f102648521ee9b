"""From evidence to names: which effects are adopted, which only resemble, which are twins.

Evidence alone is too generous: no model of a real robot is exact, and what a large effect's
formula leaves over is seen by hundreds of rows. So a name must also be large enough to matter,
win on rows that were not fitted, beat its own placebo, and not be the neighbour of a cause that
is outside of the library and explains the rows better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from postproc.gap.choice.rivals import doubtful, shadowed, twins
from postproc.gap.fit import (
    CLEAR,
    Bench,
    Evidence,
    Gram,
    Search,
    Subset,
    evidence_of,
    imitated,
    search,
    small,
    smallest_part,
    unique_part,
    unphysical,
    weakest,
)


@dataclass(slots=True)
class Choice:
    """Names and evidence. ``keys``: blocks of the library; ``suspects``: blocks outside of it.

    ``silent``: blocks that the rows call for but that are too small to be named. They stay beside
    the others, else something worse would be called in their place.
    """

    keys: Subset
    suspects: Subset
    silent: Subset
    evidence: dict[str, Evidence]
    probability: dict[str, float]
    refused: dict[str, str] = field(default_factory=dict)


def choose(bench: Bench) -> Choice:
    """Return the names that the rows support."""
    folds = bench.fold_grams()
    found, barred, refused = _searched(bench, folds)
    found, best = _readmitted(bench, found, folds, found.best, refused)
    best = _pruned(bench, found, folds, best, refused)
    found, best = _readmitted(bench, found, folds, best, refused)
    evidence = _all_evidence(bench, found, folds, best)
    silent = small(bench, best, evidence)
    refused |= {bench.name(k): "too small to tell from noise" for k in silent}
    suspects = tuple(k for k in best if bench.block(k).suspect and k not in silent)
    keys = tuple(k for k in best if k not in (*suspects, *silent))
    keys = shadowed(bench, keys, suspects, evidence, refused)
    for key in (*keys, *suspects):
        evidence[key].twins = twins(bench, found, best, key, barred)
    keys, suspects, doubted = doubtful(bench, keys, suspects, evidence, refused)
    silent = (*silent, *doubted)
    keys = tuple(sorted(keys, key=lambda k: -evidence[k].unique))
    return Choice(keys, suspects, silent, evidence, found.inclusion(), refused)


def _searched(bench: Bench, folds: Sequence[Gram]) -> tuple[Search, set[str], dict[str, str]]:
    """Search until nothing in the best subset is disqualified.

    Returns:
        the search, keys that were barred, and names refused with the reason.
    """
    gram = bench.gram()
    barred: set[str] = set()
    refused: dict[str, str] = {}
    found = search(gram, bench.always)
    for _ in range(12):
        weak = _disqualified(bench, found, folds)
        if weak is None:
            break
        key, reason = weak
        refused[found.names[key]] = reason
        barred.add(key)
        found = search(gram, bench.always, barred=barred)
    return found, barred, refused


def _all_evidence(
    bench: Bench, found: Search, folds: Sequence[Gram], best: Subset
) -> dict[str, Evidence]:
    return {k: evidence_of(bench, found, folds, best, k) for k in best}


def _disqualified(bench: Bench, found: Search, folds: Sequence[Gram]) -> tuple[str, str] | None:
    best = found.best
    evidence = _all_evidence(bench, found, folds, best)
    return (
        unphysical(bench, found, best)
        or weakest(bench, best, evidence)
        or imitated(bench, best, small(bench, best, evidence), evidence)
    )


def _pruned(
    bench: Bench, found: Search, folds: Sequence[Gram], best: Subset, refused: dict[str, str]
) -> Subset:
    """Take blocks away that only share among them what fewer would explain as well.

    Blocks too small to be named may stay where they are small together. Where they are not, each
    of them is small because the others take its place: the least of them goes, until the rest
    are named or small.
    """
    while True:
        evidence = _all_evidence(bench, found, folds, best)
        little = small(bench, best, evidence)
        together = unique_part(bench, found, best, little)
        if len(little) < 2 or together < smallest_part(bench, best, evidence, little[0]):
            return best
        least = min(little, key=lambda k: (evidence[k].gain, k))
        refused[bench.name(least)] = "others explain the same"
        best = tuple(k for k in best if k != least)


def _readmitted(
    bench: Bench,
    found: Search,
    folds: Sequence[Gram],
    best: Subset,
    refused: dict[str, str],
) -> tuple[Search, Subset]:
    """Give blocks that are not in the subset a second chance beside this company, best first.

    Only what would be named comes back.
    """
    for block in bench.blocks:
        found = found.knowing(block)
    tried = {*best, *bench.always}
    while True:
        here = found.score(best)
        gains = {
            b.key: found.score((*best, b.key)) - here
            for b in bench.blocks
            if b.key not in tried
            and found.legal((*best, b.key))
            and not refused.get(b.name, "").startswith("not physical")
        }
        key = max(gains, key=lambda k: (gains[k], k), default="")
        if not key or gains[key] < CLEAR:
            return found, best
        tried.add(key)
        subset = tuple(sorted((*best, key)))
        evidence = _all_evidence(bench, found, folds, subset)
        named = key not in small(bench, subset, evidence)
        if named and not weakest(bench, subset, evidence) and not unphysical(bench, found, subset):
            best = subset
            refused.pop(bench.name(key), None)
