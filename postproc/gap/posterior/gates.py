"""The three gates of a name, and the verdict.

Evidence says which of the candidates are best, not that one of them is the cause. So

1. what rows scatter by beside the names is held against the noise of repeats or instrument: what is
   more than noise may imitate any name of its own size;
2. steps, ramps and creeps of the instrument, and every function of something logged that no effect
   has the formula of, are candidates themselves: a set that needs one is no explanation;
3. a name must hold on rows that it was not fitted to, held out by place, time, load and design.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.gap.data import Designs
from postproc.gap.fit import Noise, Projection
from postproc.gap.posterior.chosen import Posterior
from postproc.gap.posterior.classes import LOUD, Part, groups_of, wandering
from postproc.gap.posterior.evidence import Optimum, held_out, left_out, optimum
from postproc.gap.posterior.likelihood import row_roots
from postproc.gap.posterior.names import Name, names_of, unique_part
from postproc.gap.posterior.prior import Candidate, Equations, Sort, of_group
from postproc.gap.posterior.residual import Dependence, dependences
from postproc.gap.posterior.search import Subset, climbed, explored, search
from postproc.records import dataclass

DECISIVE = 6.0
"""Nats that a name must bring which rows that were not fitted do not confirm."""
SMALLEST, SMALLEST_SHARE = 0.5, 0.05
"""Unique part of a named effect, 3D rms: in noise per axis; against the largest name, below which
it may be a flaw of that one's formula."""
STRUCTURE = 1.0
"""Structured rest, 3D rms in noise per axis, from which "explained" is no longer said."""
INEXACT = 0.04
"""What the formula of an effect may leave against what it explains, 3D rms: none is exact."""
OUTWEIGHS = 2.0
"""Unique part of a name over what nothing explains, from which the name holds beside it."""
_CALM = 1.0 / 3.0
"""The same of the part that a logged column surely tells, whatever the size of the names."""
_SURE_TEST = 1e-3
_F_RATIO, _DEVICE_RATIO, _DEVICE = 1.35, 2.0, 40
"""Variance of the rest over that of repeats, of an instrument, from which it is more than noise,
where significant; freedom of an instrument's figure."""
_SURE_RATIO = 1e-2
"""Chance of such a ratio by noise alone, below which "explained" is not said: thirty degrees of
freedom of repeats can hardly ever show more."""
_BEYOND = 1.7
"""Structured rest, 3D rms, over the bound of an unknown noise per axis."""
_HARM, _HARM_SHARE = 12.0, 0.1
"""Nats of harm on one design that refuse a name, and their share of all it brings."""
_MOST_CLASSES = 4
_ROUNDS = 6


@dataclass(frozen=True, slots=True)
class Judged:
    """Names that stand, and what they leave.

    adopted; resembled: keys of candidates in the set that are no names; reasons: why
    effects are not adopted, by name; optimum: of names alone, with frames, wander and what is too
    small for a name; structure: 3D rms [m] of what they leave beyond noise; rest: by class; tests;
    sigma: noise [m], where nothing tells it what rows scatter by; elsewhere: by name and design
    what it brings where it was not fitted [nats].
    """

    posterior: Posterior
    whole: Optimum
    optimum: Optimum
    adopted: tuple[Name, ...]
    resembled: Subset
    reasons: dict[str, str]
    structure: float
    rest: tuple[Part, ...]
    tests: tuple[Dependence, ...]
    sigma: float
    elsewhere: dict[str, dict[str, float]]

    @property
    def inclusion(self) -> dict[str, float]:
        """Probability of effects over the sets visited, by name."""
        of, found = self.posterior, dict[str, float]()
        for key, value in of.search.inclusion().items():
            name = of.candidate(key).name
            found[name] = max(found.get(name, 0.0), value)
        return found

    def left(self, names: Sequence[Name]) -> float:
        """Return what some names and the frames leave of the searched rows [m^2]."""
        search = self.posterior.search
        keys = (*search.always, *(k for n in names for k in n.keys))
        return optimum(search.equations, keys, self.posterior.prior, self.whole, held=True).left

    def missed(self, keys: Sequence[str], label: IntArray) -> float:
        """Return by how much rows are missed by fits without their label, 3D rms [m].

        Args:
            keys: of candidates beside the frames.
            label: (n,) of the searched rows.
        """
        search = self.posterior.search
        inside = tuple(dict.fromkeys((*search.always, *keys)))
        held = optimum(search.equations, inside, self.posterior.prior, self.whole, held=True)
        return left_out(search.equations, held, label)[0]

    @property
    def told(self) -> tuple[str, ...]:
        """Columns that were logged and surely tell a part of what is left that counts."""
        sure = _SURE_TEST / max(len(self.tests), 1)
        some = (t for t in self.tests if t.logged and t.p_value < sure)
        return tuple(t.name for t in some if t.rms > _CALM * self.sigma)

    @property
    def verdict(self) -> str:
        """``explained``, ``no_gap``, ``unexplained`` or ``undetermined``."""
        level = self.posterior.level
        limit = tolerated(self.adopted, self.sigma)
        if not level.known:
            most = max(limit, _BEYOND * level.upper)
            return "unexplained" if self.structure > most else "undetermined"
        if self.resembled or self.structure > limit or self.told:
            return "unexplained"
        if level.is_doubted:
            return "undetermined"
        return "explained" if self.adopted else "no_gap"


def tolerated(adopted: Sequence[Name], sigma: float) -> float:
    """Return the structured rest, 3D rms [m], up to which names explain the gap."""
    return max(STRUCTURE * sigma, INEXACT * max((n.unique for n in adopted), default=0.0))


def judged(of: Posterior) -> Judged:
    """Return the names of a posterior that pass the gates."""
    reasons: dict[str, str] = {}
    divisions = _divisions(of)
    sigma = of.level.sigma if of.level.known else of.best.sigma
    for _ in range(_ROUNDS):
        here = of.search.best
        at = of.search.found[here]
        held = _held(of, at, divisions)
        failed = min(held, key=lambda name: (held[name][0], name), default="")
        if not failed or held[failed][0] >= 0.0:
            break
        reasons[failed] = "does not hold on rows not fitted"
        of.search.barred.add(failed)
        explored(of.search, climbed(of.search, of.search.best))
    whole = of.search.found[of.search.best]
    held = _held(of, whole, divisions)
    names = tuple(replace(n, is_half=held[n.name][1] <= 0.0) for n in names_of(of, whole))
    small = [n for n in names if n.unique < _smallest(names, sigma)]
    reasons |= dict.fromkeys((n.name for n in small), "too small to tell from noise")
    vague = [n for n in names if n.gain < DECISIVE and n.is_half and n not in small]
    reasons |= dict.fromkeys((n.name for n in vague), "not clear enough")
    small += vague
    standing = tuple(n for n in names if n not in small)
    result = _left(of, whole, standing, tuple(small), reasons, sigma)
    weak = [n for n in standing if not _outweighs(n, result)]
    if weak:
        reasons |= dict.fromkeys((n.name for n in weak), "what is left may be imitating it")
        standing = tuple(n for n in standing if n not in weak)
        result = _left(of, whole, standing, tuple(small), reasons, sigma)
    return replace(result, elsewhere=_elsewhere(of, result))


def _smallest(names: Sequence[Name], sigma: float) -> float:
    """Return the unique part from which a name is given, 3D rms [m]."""
    largest = max(n.unique for n in names)
    return max(SMALLEST * sigma, SMALLEST_SHARE * largest)


def _outweighs(name: Name, result: Judged) -> bool:
    """Return whether a name is far larger than what nothing explains."""
    if result.structure <= tolerated(result.adopted, result.sigma):
        return True
    ratio = 0.5 if name.effect.geometric else OUTWEIGHS
    return name.unique > ratio * result.structure


def _left(
    of: Posterior,
    whole: Optimum,
    adopted: tuple[Name, ...],
    unnamed: tuple[Name, ...],
    reasons: dict[str, str],
    noise: float,
) -> Judged:
    """Return what some names leave."""
    stays = {k for n in (*adopted, *unnamed) for k in n.keys}
    kept = [k for k in whole.keys if k in of.search.always or k in stays]
    waves = [k for k in whole.keys if of.candidate(k).sort is Sort.WANDER]
    if _rms(of.moved(whole, waves)) > LOUD * float(np.sqrt(3.0)) * max(of.level.wander, noise):
        waves = []
    kept += waves
    other = tuple(k for k in whole.keys if of.candidate(k).sort in (Sort.CLASS, Sort.RESEMBLANCE))
    alone = optimum(of.search.equations, kept, of.prior, whole)
    rest = of.problem.onto(of.at.z - of.moved(alone, alone.keys), of.at.index)
    weight = of.weight / (noise * of.problem.relative[of.at.index])
    X = np.concatenate(
        [np.zeros((len(rest), 3, 0)), *(of.candidate(k).X for k in alone.keys)], axis=2
    )
    context = Projection(X * alone.deviation, of.at.z, weight)
    tests = dependences(of.at.samples, rest, weight, context, alone.free)
    parts = wandering(of.level, _classes_of(of, alone, noise))
    size = of.level.white if any(of.candidate(k).sort is Sort.WANDER for k in kept) else 0.0
    sigma = size if size > 0.0 else noise
    beyond = unique_part(of, whole, other) if other else 0.0
    structure = max(
        _beyond(alone, of.level, sigma),
        max((t.rms for t in tests if t.p_value < _SURE_TEST / max(len(tests), 1)), default=0.0),
        float(np.sqrt(sum(p.rms**2 for p in parts))),
        beyond,
    )
    return Judged(
        of,
        whole,
        alone,
        adopted,
        other if beyond > SMALLEST * noise else (),
        reasons,
        structure,
        parts,
        tests,
        noise,
        {},
    )


def _rms(moved: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(moved**2, axis=1)))) if len(moved) else 0.0


def _beyond(alone: Optimum, level: Noise, sigma: float) -> float:
    """Return the 3D rms [m] that a set leaves beyond a noise [m] per axis, 0 where it is none."""
    from scipy.special import fdtrc

    if not level.known:
        return 0.0
    ratio = (alone.sigma / sigma) ** 2
    freedom, most = (level.freedom, _F_RATIO) if level.freedom else (_DEVICE, _DEVICE_RATIO)
    if ratio <= most or fdtrc(alone.free, freedom, ratio) >= _SURE_RATIO:
        return 0.0
    return float(np.sqrt(3.0 * (alone.sigma**2 - sigma**2)))


def _classes_of(of: Posterior, alone: Optimum, sigma: float) -> tuple[Part, ...]:
    """Return the classes of what a set leaves, largest first: of whatever formula."""
    kept = [of.candidate(k) for k in alone.keys]
    groups = [g for g in groups_of(of.at.samples, of.moments) if g.X.shape[2]]
    root = row_roots(of.problem, of.at.index, of.weight)
    candidates: list[Candidate] = [*kept, *(of_group(g) for g in groups)]
    equations = Equations.of(candidates, of.at.z, root)
    found = search(equations, of.prior, alone.keys, near=alone, deep=False)
    best = found.found[found.best]
    parts = []
    for key in found.best[:_MOST_CLASSES]:
        group, part = equations.by_key[key].group, best.part(equations, key)
        if group is None:
            continue
        rms = _rms(equations.by_key[key].X @ best.theta[part])
        rest = tuple(k for k in found.best if k != key)
        gain = best.value - found.optimum(rest, best).value
        if rms > SMALLEST * sigma:
            parts.append(Part(group.kind, group.of, group.shape, rms, gain))
    return tuple(sorted(parts, key=lambda p: (-p.rms, p.kind, p.of)))


def _divisions(of: Posterior) -> list[tuple[Designs, bool]]:
    """Return ways to part the searched rows, and whether each part is a design of its own."""
    problem, index = of.problem, of.at.index
    parts = problem.split
    found = [
        (_numbered(parts.fold[index], "place"), False),
        (_numbered(parts.stretch[index], "time"), False),
        (problem.design.rows(index), True),
    ]
    if len(problem.set_ups.stations) > 1:
        label = problem.set_ups.station[index]
        found.append((Designs(label, problem.set_ups.stations, "layout"), True))
    wrench = problem.samples.wrench
    if wrench is not None and bool(np.any(wrench)):
        size = np.linalg.norm(wrench[index, :3], axis=1)
        label = np.digitize(size, np.quantile(size, [1 / 3, 2 / 3]))
        found.append((_numbered(label.astype(np.int32), "load"), False))
    return [(d, strict) for d, strict in found if len(d) > 1]


def _numbered(label: IntArray, word: str) -> Designs:
    return Designs(label, tuple(f"{word} {k}" for k in range(int(label.max()) + 1)), "layout")


def _held(
    of: Posterior, at: Optimum, divisions: Sequence[tuple[Designs, bool]]
) -> dict[str, tuple[float, float]]:
    """Return, by name, what it brings on rows not fitted [nats], its error added and taken off."""
    by_name: dict[str, list[str]] = {}
    for key in at.keys:
        if of.candidate(key).sort not in (Sort.FRAME, Sort.WANDER):
            by_name.setdefault(of.candidate(key).name, []).append(key)
    found = dict.fromkeys(by_name, (np.inf, np.inf))
    for label, strict in divisions:
        for name, gains in held_out(of.search.equations, at, by_name, label.label).items():
            total, error = float(gains.sum()), float(np.std(gains) * np.sqrt(len(gains)))
            harm = strict and float(gains.min()) < -max(_HARM, _HARM_SHARE * total)
            most, least = found[name]
            most = min(most, float(gains.min()) if harm else total + error)
            found[name] = (most, min(least, total - error))
    return found


def _elsewhere(of: Posterior, result: Judged) -> dict[str, dict[str, float]]:
    """Return what each name brings on each design that it was not fitted to [nats]."""
    label = of.problem.design.rows(of.at.index)
    if len(label) < 2:
        return {}
    keys = {name.name: name.keys for name in result.adopted}
    told = held_out(of.search.equations, result.whole, keys, label.label)
    return {
        name: dict(zip(label.names, gains.tolist(), strict=False)) for name, gains in told.items()
    }
