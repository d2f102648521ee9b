"""The numbers of the names: exact model, all rows that are sound, and the same without some rows.

Beside the names, what else the posterior has (resemblances, classes, wander, effects too small for
a name) is taken from the readings: else the names would take it in. A model that is to serve, and
not only to name, holds all that is the arm's, fitted to the readings together.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.effect import Kind
from postproc.gap.fit import WIDE, Fit, Free, Parted, Problem, Tangent, fit, gross_faults
from postproc.gap.posterior.chosen import free_of
from postproc.gap.posterior.classes import groups_of
from postproc.gap.posterior.evidence import NoisePrior, Optimum, left_out, optimum
from postproc.gap.posterior.gates import Judged
from postproc.gap.posterior.likelihood import Linearised, row_roots, student
from postproc.gap.posterior.prior import Candidate, Equations, Sort, of_effect, of_group, wander
from postproc.gap.posterior.search import Subset
from postproc.gap.robot_model import evaluate
from postproc.measurement import robust_sigma
from postproc.records import dataclass

LARGEST_FIT = 4000
"""Rows that numbers are fitted to; more make them no surer."""
_FAULT = 6.0
"""Rest of a row over the usual one from which the row is a measuring fault."""
_DIRECTIONS = 24
"""In which the numbers of a model are said to be wrong together: file size against detail."""
_MOST_FAULTS = 0.06
"""Largest share of rows that may be faults."""


@dataclass(frozen=True, slots=True)
class Named:
    """A fit of some names to rows, of which these alone are kept.

    full: with what stands beside them taken from the readings; fit: frames fitted once more to what
    is kept; tangent: of the first; place, time: it, parted by those.
    """

    problem: Problem
    full: Fit
    fit: Fit
    tangent: Tangent
    place: Parted
    time: Parted

    @classmethod
    def of(
        cls,
        problem: Problem,
        free: dict[str, Free],
        sigma: float,
        rows: BoolArray,
        beside: FloatArray,
    ) -> Named:
        """Fit effects to some rows (n,), readings without what is beside (n, 3) [m]."""
        index = np.flatnonzero(rows)
        weight = problem.by(np.full(len(index), 1.0 / sigma), index)
        samples, measured, given = problem.samples, problem.measured, problem.given
        part = samples.rows(index)
        full = fit(part, (measured - beside)[index], weight, given, free)
        full = replace(full, point=evaluate(samples, full.states)[0])
        # what every arm has more or less is open whether it was named or not
        usual = [e for e in problem.effects if e.is_common or e.kind == Kind.REGISTRATION]
        open_ = {e.name: Free(problem.settings[e.name]) for e in usual if e.name not in given}
        rest = measured - full.point
        by = problem.by(np.where(rows, 1.0 / sigma, 0.0))
        tangent = Tangent.of(samples, full.states, given, open_ | free, rest, by, beside)
        kept = full
        if problem.always and np.any(beside):
            frames = fit(part, measured[index], weight, full.states, frames_of(problem))
            states = full.states | {n: frames.states[n] for n in problem.always}
            kept = replace(full, states=states, point=evaluate(samples, states)[0])
        # postures that are all alike have no places
        split, time = problem.split, tangent.parted(problem.split.stretch)
        place = tangent.parted(split.fold) if split.folds > 1 else time
        return cls(problem, full, kept, tangent, place, time)

    def held(self, names: Collection[str] | None = None) -> FloatArray:
        """Return how far each row (n,) is missed [m] without its place or its time.

        Args:
            names: of effects that alone are fitted beside the frames; None: all.
        """
        square = [self.missed(parted, names) ** 2 for parted in (self.place, self.time)]
        return np.asarray(np.sqrt(np.mean(square, axis=0)))

    def sealed(self, names: Collection[str] | None = None) -> FloatArray:
        """Return how far each sealed row (n,) is missed [m] by a fit without any of them."""
        parted = self.tangent.parted(self.problem.split.sealed.astype(np.int32))
        return self.missed(parted, names)

    def missed(self, parted: Parted, names: Collection[str] | None = None) -> FloatArray:
        """Return how far each row (n,) is missed [m] by the fit without the rows of its label."""
        always = self.problem.always
        some = self.full.slices if names is None else dict.fromkeys((*always, *names))
        left = self.problem.onto(parted.missed(some, always))
        return np.asarray(np.linalg.norm(left, axis=1))

    @property
    def deviations(self) -> dict[str, FloatArray]:
        """Standard deviations (p,) of each effect's numbers, SI.

        The larger of the fit's own, which knows noise alone, and the delete-a-group jackknife over
        neighbouring poses (Efron 1982): a formula that is not exact gives other numbers in another
        corner of the workspace.
        """
        apart = _jackknife(self.place.numbers(self.full.slices)) @ self.tangent.root.T
        slices = self.tangent.slices
        scatter = np.sqrt(np.sum(apart**2, axis=0))
        own = {name: self.full.deviation(name) for name in self.full.slices}
        if len(apart) < 3:
            return own
        return {name: np.maximum(own[name], scatter[slices[name]]) for name in own}

    @property
    def spread(self) -> dict[str, FloatArray]:
        """How the numbers may be wrong together: by effect (d, p), in usual sizes.

        The directions of what noise leaves open and of the jackknife, as in ``deviations``, that
        move the tool most over the poses measured.
        """
        of, apart = self.tangent, _jackknife(self.place.numbers(self.full.slices))
        inverse = np.linalg.inv(self.place.H.sum(axis=0) + np.eye(len(of.u)))
        root = np.linalg.cholesky(inverse + apart.T @ apart)
        moved = (of.X @ root).reshape(-1, len(root))
        axes = np.linalg.eigh(moved.T @ moved)[1][:, -_DIRECTIONS:]
        widest = (of.root @ root @ axes).T / of.size
        return {name: widest[:, part] for name, part in of.slices.items()}


def _jackknife(numbers: FloatArray) -> FloatArray:
    """Return deviations (k, p) whose squares sum to the delete-a-group variance."""
    centred = numbers - numbers.mean(axis=0)
    return np.asarray(centred * np.sqrt((len(numbers) - 1) / len(numbers)))


def frames_of(problem: Problem) -> dict[str, Free]:
    """Return the frames of a registration, free."""
    return {n: Free(problem.settings[n], WIDE) for n in problem.always}


def thinned(rows: BoolArray) -> BoolArray:
    """Return at most ``LARGEST_FIT`` of some rows (n,)."""
    index = np.flatnonzero(rows)
    out = np.zeros(len(rows), dtype=bool)
    out[index[:: max(-(-len(index) // LARGEST_FIT), 1)]] = True
    return out


@dataclass(frozen=True, slots=True)
class Serving:
    """Effects of the arm that a model file may hold.

    keys: of their candidates; at: optimum of these with the frames and all that is in no model;
    beside: (n, 3) what the latter moves the readings by [m].
    """

    judged: Judged
    keys: Subset
    at: Optimum
    beside: FloatArray

    def free(self) -> dict[str, Free]:
        """Return the effects and the frames as a fit takes them."""
        return free_of(self.judged.posterior, self.keys, self.at)


def servings(judged: Judged) -> tuple[tuple[Serving, ...], BoolArray]:
    """Return what a model may hold: the names alone, then all that the rows may tell; faults (n,).

    A cause too small for a name, or too like another, still says where the tool will be: its scale
    is found with all others, on the readings themselves. Where names do not explain the gap, that
    are the geometry, the sag and the tables of all joints, and only what is the instrument's stands
    beside.
    """
    of, whole = judged.posterior, judged.whole
    names = tuple(k for n in judged.adopted for k in n.keys)
    rows = _AllRows.of(judged)
    found = [Serving(judged, names, whole, rows.beside(whole, names))]
    keys = _telling(judged)
    if set(keys) > set(names):
        beside = [k for k in whole.keys if of.candidate(k).is_device and k not in keys]
        inside = dict.fromkeys((*of.search.always, *keys, *beside))
        at = _cautious(judged, tuple(inside))
        moved = rows.beside(at, keys) if beside else np.zeros((len(rows.size), 3))
        found.append(Serving(judged, keys, at, moved))
    return tuple(found), rows.faults()


def _cautious(judged: Judged, keys: Subset) -> Optimum:
    """Return a set at its scales, its noise no less than what explains how places are missed."""
    of = judged.posterior
    equations, label = of.search.equations, of.problem.split.fold[of.at.index]
    at = optimum(equations, keys, of.prior, judged.whole)
    noise = NoisePrior(left_out(equations, at, label)[1], equations.readings)
    return optimum(equations, keys, noise, at)


def _telling(judged: Judged) -> Subset:
    """Return what tells most of the arm: where names do not explain the gap, what all arms have."""
    of = judged.posterior
    named = {k for n in judged.adopted for k in n.keys}
    causes = [k for k in judged.whole.keys if of.candidate(k).sort is Sort.CAUSE]
    causes = [k for k in causes if k in named or not of.candidate(k).is_device]
    if judged.verdict in ("explained", "no_gap"):
        return tuple(causes)
    waves = {joint for k in named for joint in of.candidate(k).waves}
    every = of.search.equations.candidates
    usual = [c.key for c in every if c.effect is not None and c.effect.is_common]
    tables = [c.key for c in every if c.tables and waves.isdisjoint(c.tables)]
    return tuple(dict.fromkeys((*(k for k in causes if k in named), *usual, *tables)))


@dataclass(frozen=True, slots=True)
class _AllRows:
    """All rows at the pose that the most probable set brings the arm to.

    weight: (n,) roots of their weights, 0 for those that are not fitted; size: (n,) what is left of
    each row, in the usual one of the sound; gross: (n,) faults that are plain.
    """

    judged: Judged
    at: Linearised
    weight: FloatArray
    size: FloatArray
    gross: BoolArray

    @classmethod
    def of(cls, judged: Judged) -> _AllRows:
        """Return the rows of a campaign."""
        of, whole, problem = judged.posterior, judged.whole, judged.posterior.problem
        effects = [k for k in whole.keys if _has_effect(of.candidate(k))]
        index, n = of.at.index, len(problem)
        beside = of.moved(whole, [k for k in whole.keys if not _has_effect(of.candidate(k))])
        by = problem.by(of.weight / whole.sigma, index)
        measured, samples = problem.measured[index] - beside, problem.samples.rows(index)
        found = fit(samples, measured, by, problem.given, free_of(of, effects, whole))
        at, gross = Linearised.at(problem, np.arange(n), found.states), gross_faults(problem.gap)
        here = cls(judged, at, thinned(~gross).astype(float), np.ones(n), gross)
        for _ in range(2):
            moved, scatter = here._fitted(whole)
            size = problem.size(at.z - sum(moved.values(), np.zeros_like(at.z)))
            # few rows beside many numbers lie closer to the fit than they scatter
            level = max(scatter, of.level.sigma if of.level.known else 0.0)
            sigma = max(robust_sigma(size[~gross]), level)
            weight = np.where(here.weight > 0.0, student(size / sigma), 0.0)
            here = replace(here, weight=weight, size=size / sigma)
        return here

    def _fitted(self, whole: Optimum) -> tuple[dict[str, FloatArray], float]:
        """Return what the candidates of a set, at its scales, move the points by, and the noise."""
        of, n = self.judged.posterior, len(self.at.z)
        candidates = [_at(c, self.at, self.judged) for c in map(of.candidate, whole.keys)]
        root = row_roots(of.problem, np.arange(n), self.weight)
        equations = Equations.of(candidates, self.at.z, root)
        here = optimum(equations, whole.keys, of.prior, whole, held=True)
        theta = {c.key: here.theta[here.part(equations, c.key)] for c in candidates}
        return {c.key: c.X @ theta[c.key] for c in candidates}, here.sigma

    def beside(self, whole: Optimum, written: Sequence[str]) -> FloatArray:
        """Return what all of a set but frames and some move the readings by (n, 3) [m]."""
        candidate = self.judged.posterior.candidate
        gone = {k for k in whole.keys if candidate(k).sort is Sort.FRAME} | set(written)
        total = np.zeros_like(self.at.z)
        if not gone >= set(whole.keys):
            total += sum(m for k, m in self._fitted(whole)[0].items() if k not in gone)
        return total

    def faults(self) -> BoolArray:
        """Return (n,) the rows that are measuring faults."""
        bad: BoolArray = self.size > _FAULT
        sound = ~self.gross
        if bad[sound].mean() > _MOST_FAULTS:
            bad &= self.size > np.quantile(self.size[sound], 1.0 - _MOST_FAULTS)
        return np.asarray(bad | self.gross)


def _has_effect(candidate: Candidate) -> bool:
    return candidate.effect is not None and candidate.sort is not Sort.FRAME


def _at(candidate: Candidate, at: Linearised, judged: Judged) -> Candidate:
    """Return a candidate at other rows."""
    of = judged.posterior
    if candidate.effect is not None:
        always = candidate.sort is Sort.FRAME
        setting = candidate.setting or {}
        return of_effect(candidate.effect, at.samples, setting, candidate.key, always)
    if candidate.sort is Sort.WANDER:
        return next(
            c
            for c in wander((w.key, w.X[at.index]) for w in of.problem.wanders)
            if c.key == candidate.key
        )
    groups = (of_group(g) for g in groups_of(at.samples, of.moments) if g.X.shape[2])
    return next(c for c in groups if c.key == candidate.key)
