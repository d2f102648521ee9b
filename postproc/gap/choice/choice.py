"""From evidence to names: which effects are adopted, which only resemble, which are confounded.

Evidence alone is too generous: no model of a real robot is exact, and what a large effect's
formula leaves over is seen by hundreds of rows. So a name must also be large enough to matter,
win on rows that were not fitted, beat its own placebo, and not be what an alternative outside of
the library is mistaken for that explains the rows better.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.gap.choice.confounding import (
    confounded_with,
    in_place_of_two,
    overruled,
    replaceable,
    taken_in_by,
)
from postproc.gap.choice.evidence import (
    UNHELPFUL,
    Evidence,
    Folds,
    evidence_of,
    matched_by_placebo,
    negligible,
    smallest_part,
    unique_part,
    unphysical,
    weakest,
)
from postproc.gap.choice.search import DECISIVE, TEMPERATURE, Search, search
from postproc.gap.choice.standing import Choice, Standing
from postproc.gap.fit import NormalEquations, Regression, Subset

_SEARCHES = 12
"""How often all subsets are searched anew without a block that was disqualified."""


def choose(regression: Regression) -> Choice:
    """Return the names that the rows support."""
    whole = regression.equations_at(np.arange(len(regression.y)))
    folds = [
        [(part, whole.minus(part)) for part in parts]
        for parts in (regression.fold_equations(), regression.stretch_equations())
    ]
    found, excluded, best = _searched(regression, folds, whole)
    reasons = {regression.name(key): why for key, why in excluded.items()}
    found, best = _readmitted(regression, found, folds, best, reasons)
    best = _pruned(regression, found, folds, best, reasons)
    found, best = _readmitted(regression, found, folds, best, reasons)
    evidence = _all_evidence(regression, found, folds, best)
    standing = _standing(regression, best, evidence)
    reasons |= {
        regression.name(key): "too small to tell from noise"
        for key, its in standing.items()
        if its is Standing.UNNAMED
    }
    choice = overruled(regression, Choice(standing, evidence, {}, reasons))
    if found.score(best) - found.score(()) < TEMPERATURE:
        by_chance = {regression.name(key): "a chance finding may be as large" for key in best}
        choice = choice.moved(best, Standing.REJECTED, by_chance)
    barred = [key for key, why in excluded.items() if why != UNHELPFUL]
    instead = in_place_of_two(regression, found, best, choice.adopted, barred)
    confounded = {}
    for key in (*choice.adopted, *choice.resembled):
        same = {
            *confounded_with(regression, found, best, key, excluded),
            *taken_in_by(regression, best, evidence, key),
            *instead.get(key, ()),
        }
        confounded[key] = replace(evidence[key], confounded=tuple(sorted(same)))
    # the sets that would do as well are among the subsets visited by now
    choice = replace(choice, evidence=evidence | confounded, probability=found.inclusion())
    return replaceable(regression, choice)


def _standing(
    regression: Regression, best: Subset, evidence: Mapping[str, Evidence]
) -> dict[str, Standing]:
    """Return the standing of the blocks of a subset by their size and kind."""
    small = negligible(regression, best, evidence)
    standing = {}
    for key in best:
        other = regression.block(key).is_alternative
        standing[key] = Standing.RESEMBLED if other else Standing.ADOPTED
    return standing | dict.fromkeys(small, Standing.UNNAMED)


def _searched(
    regression: Regression, folds: Folds, plain: NormalEquations
) -> tuple[Search, dict[str, str], Subset]:
    """Search until nothing in the best subset is disqualified.

    Where that takes too long the last one loses what is, block by block: few rows follow many
    causes about as well, each of which fails, and what is there beside them does not.

    Returns:
        the search, keys that were excluded with the reason, and the best subset.
    """
    equations = regression.normal_equations()
    excluded: dict[str, str] = {}
    found = search(equations, regression.always, plain=plain)
    for _ in range(_SEARCHES):
        weak = _disqualified(regression, found, folds, found.best)
        if weak is None:
            return found, excluded, found.best
        key, reason = weak
        excluded[key] = reason
        found = search(
            equations, regression.always, excluded=excluded, known=found.scores, plain=plain
        )
    best = found.best
    while weak := _disqualified(regression, found, folds, best):
        key, reason = weak
        excluded[key] = reason
        best = tuple(k for k in best if k != key)
    return found, excluded, best


def _all_evidence(
    regression: Regression, found: Search, folds: Folds, best: Subset
) -> dict[str, Evidence]:
    return {k: evidence_of(regression, found, folds, best, k) for k in best}


def _disqualified(
    regression: Regression, found: Search, folds: Folds, best: Subset
) -> tuple[str, str] | None:
    evidence = _all_evidence(regression, found, folds, best)
    return (
        unphysical(regression, found, best)
        or weakest(regression, best, evidence)
        or matched_by_placebo(regression, best, negligible(regression, best, evidence))
    )


def _pruned(
    regression: Regression,
    found: Search,
    folds: Folds,
    best: Subset,
    reasons: dict[str, str],
) -> Subset:
    """Take blocks away that only share among them what fewer would explain as well.

    Blocks too small to be named may stay where they are small together. Where they are not, each
    of them is small because the others take its place: the least of them goes, until the rest
    are named or small.
    """
    while True:
        evidence = _all_evidence(regression, found, folds, best)
        little = negligible(regression, best, evidence)
        together = unique_part(regression, found, best, little)
        if len(little) < 2 or together < smallest_part(regression, best, evidence, little[0]):
            return best
        least = min(little, key=lambda k: (evidence[k].gain, k))
        reasons[regression.name(least)] = "others explain the same"
        best = tuple(k for k in best if k != least)


def _readmitted(
    regression: Regression,
    found: Search,
    folds: Folds,
    best: Subset,
    reasons: dict[str, str],
) -> tuple[Search, Subset]:
    """Give blocks that are not in the subset a second chance beside this company, best first.

    Only what would be named comes back.
    """
    for block in regression.blocks:
        found = found.with_candidate(block)
    tried = {*best, *regression.always}
    while True:
        here = found.score(best)
        gains = {
            b.key: found.score((*best, b.key)) - here
            for b in regression.blocks
            if b.key not in tried
            and found.is_admissible((*best, b.key))
            and not reasons.get(b.name, "").startswith("not physical")
        }
        key = max(gains, key=lambda k: (gains[k], k), default="")
        if not key or gains[key] < DECISIVE:
            return found, best
        tried.add(key)
        subset = tuple(sorted((*best, key)))
        evidence = _all_evidence(regression, found, folds, subset)
        named = key not in negligible(regression, subset, evidence)
        weak = weakest(regression, subset, evidence) or unphysical(regression, found, subset)
        if named and not weak:
            best = subset
            reasons.pop(regression.name(key), None)
