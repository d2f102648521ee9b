"""The numbers of the names: exact model, all rows that are sound, and the same without some rows.

Beside the names, what else the posterior has (resemblances, classes, wander, effects too small for
a name) is taken from the readings: else the names would take it in. A model that is to serve, and
not only to name, holds all that is the arm's, fitted to the readings together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.effect import Kind
from postproc.gap.fit import (
    WIDE,
    Fit,
    Free,
    Problem,
    fit,
    gross_faults,
    left_open,
    moved_points,
    without_blocks,
)
from postproc.gap.posterior.chosen import Posterior, free_of
from postproc.gap.posterior.classes import groups_of
from postproc.gap.posterior.evidence import Optimum, optimum
from postproc.gap.posterior.gates import Judged
from postproc.gap.posterior.likelihood import Linearised, row_roots, student
from postproc.gap.posterior.names import Name
from postproc.gap.posterior.prior import Candidate, Sort, of_effect, of_group, wander
from postproc.gap.posterior.products import Equations
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
    """A fit of some names to some rows (n,), of which these alone are kept.

    full: with what stands beside them taken from the readings (n, 3) [m]; fit: frames fitted once
    more to what is kept.
    """

    problem: Problem
    free: dict[str, Free]
    sigma: float
    rows: BoolArray
    beside: FloatArray
    full: Fit
    fit: Fit

    @classmethod
    def of(
        cls,
        problem: Problem,
        free: dict[str, Free],
        sigma: float,
        rows: BoolArray,
        beside: FloatArray,
    ) -> Named:
        """Fit effects to some rows (n,)."""
        index = np.flatnonzero(rows)
        weight = problem.by(np.full(len(index), 1.0 / sigma), index)
        part, measured = problem.samples.rows(index), problem.measured
        found = fit(part, (measured - beside)[index], weight, problem.given, free)
        full = replace(found, point=evaluate(problem.samples, found.states)[0])
        if not (problem.always and np.any(beside)):
            return cls(problem, free, sigma, rows, beside, full, full)
        states = {n: s for n, s in full.states.items() if n not in problem.always}
        frames = fit(part, measured[index], weight, states, frames_of(problem))
        states |= {n: frames.states[n] for n in problem.always}
        kept = replace(full, states=states, point=evaluate(problem.samples, states)[0])
        return cls(problem, free, sigma, rows, beside, full, kept)

    def missed(self, label: IntArray) -> FloatArray:
        """Return how far each row (n,) is missed [m] by the fit without the rows of its label.

        Args:
            label: (n,) 0..k-1.
        """
        problem, samples, states = self.problem, self.problem.samples, self.full.states
        rest = problem.measured - self.beside - self.full.point
        by = without_blocks(samples, states, self.free, rest, self._weight, label)
        ends = np.cumsum([len(states[name].theta) for name in self.free])
        parts = (
            dict(zip(self.free, np.split(by, ends[:-1], axis=1), strict=True)) if len(ends) else {}
        )
        again = frames_of(problem) if self.full is not self.fit else {}
        stays = {n: part for n, part in parts.items() if n not in again}
        moved = moved_points(samples, states, stays, np.hstack([by[:, :0], *stays.values()]))
        if again:
            rest = problem.measured - self.fit.point
            by = without_blocks(samples, self.fit.states, again, rest, self._weight, label, moved)
            moved = moved + moved_points(samples, self.fit.states, again, by)
        left = problem.rest(self.fit.point + moved[label, np.arange(len(label))])
        return np.asarray(np.linalg.norm(left, axis=1))

    def deviations(self, label: IntArray) -> dict[str, FloatArray]:
        """Return the standard deviations (p,) of each effect's numbers, SI.

        The larger of the fit's own, which knows noise alone, and the delete-a-group jackknife over
        labels of neighbouring poses (Efron 1982): a formula that is not exact gives other numbers
        in another corner of the workspace.
        """
        apart = self._jackknife(label)
        scatter = np.sqrt(np.sum(apart**2, axis=0))
        own = np.sqrt(np.diag(self.full.covariance))
        wide = np.maximum(own, scatter) if len(apart) > 2 else own
        return {name: wide[part] for name, part in self.full.slices.items()}

    def spread(self, label: IntArray) -> dict[str, FloatArray]:
        """Return how the numbers may be wrong together: by effect (d, p), in usual sizes.

        The widest directions of what noise leaves open and of the jackknife, as in
        ``deviations``. What every arm has more or less is open whether it was named or not.
        """
        problem, states = self.problem, self.full.states
        usual = [e for e in problem.effects if e.is_common or e.kind == Kind.REGISTRATION]
        every = [e for e in usual if e.name not in problem.given]
        free = {e.name: Free(problem.settings[e.name]) for e in every} | self.free
        covariance, slices, size = left_open(problem.samples, states, free, self._weight)
        apart = self._jackknife(label)
        for name, part in self.full.slices.items():
            for other, beside in self.full.slices.items():
                more = apart[:, part].T @ apart[:, beside]
                covariance[slices[name], slices[other]] += more
        values, axes = np.linalg.eigh(covariance / np.outer(size, size))
        widest = np.sqrt(np.maximum(values[-_DIRECTIONS:], 0.0))[:, None] * axes.T[-_DIRECTIONS:]
        return {name: widest[:, part] for name, part in slices.items()}

    def _jackknife(self, label: IntArray) -> FloatArray:
        """Return deviations (k, p) whose squares sum to the delete-a-group variance."""
        rest = self.problem.measured - self.beside - self.full.point
        by = without_blocks(
            self.problem.samples, self.full.states, self.free, rest, self._weight, label
        )
        return np.asarray((by - by.mean(axis=0)) * np.sqrt((len(by) - 1) / len(by)))

    @property
    def _weight(self) -> FloatArray:
        return self.problem.by(np.where(self.rows, 1.0 / self.sigma, 0.0))


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

    def free(self, names: Sequence[Name] | None = None) -> dict[str, Free]:
        """Return the effects, or those of some names, and the frames as a fit takes them."""
        of = self.judged.posterior
        keys = self.keys if names is None else [k for n in names for k in n.keys]
        return free_of(of, keys, self.at)


def servings(judged: Judged) -> tuple[tuple[Serving, ...], BoolArray]:
    """Return what a model may hold: the names alone, then all that the rows may tell; faults (n,).

    A cause too small for a name, or too like another, still says where the tool will be: its scale
    is found with all others, on the readings themselves. Where names do not explain the gap, that
    are the geometry, the sag and the tables of all joints, and only what is the instrument's stands
    beside.
    """
    of, whole = judged.posterior, judged.whole
    names = tuple(k for n in judged.adopted for k in n.keys)
    fitted = _all_rows(judged, whole)
    bad = fitted.faults()
    found = [Serving(judged, names, whole, fitted.beside(names))]
    keys = _telling(judged)
    if set(keys) > set(names):
        beside = [k for k in whole.keys if of.candidate(k).is_device and k not in keys]
        inside = dict.fromkeys((*of.search.always, *keys, *beside))
        at = optimum(of.search.equations, tuple(inside), of.prior, whole)
        moved = _all_rows(judged, at).beside(keys) if beside else np.zeros((len(bad), 3))
        found.append(Serving(judged, keys, at, moved))
    return tuple(found), bad


def _telling(judged: Judged) -> Subset:
    """Return the candidates that tell most of the arm, each joint's ripple in one form.

    What has no name and follows a logged condition, as temperature, serves no other campaign.
    """
    of = judged.posterior
    named = {k for n in judged.adopted for k in n.keys}
    causes = [k for k in judged.whole.keys if of.candidate(k).sort is Sort.CAUSE]
    causes = [k for k in causes if k in named or not of.candidate(k).is_device]
    if judged.verdict in ("explained", "no_gap"):
        return tuple(causes)
    waves = {k for k in causes if of.candidate(k).waves}
    in_waves = {joint for k in waves & named for joint in of.candidate(k).waves}
    every = of.search.equations.candidates
    usual = [c.key for c in every if c.effect is not None and c.effect.is_common]
    tables = [c for c in every if c.tables and (c.key in named or in_waves.isdisjoint(c.tables))]
    known = {c.key for c in every if c.effect is not None and not c.effect.unknown_to_programs}
    stay = [k for k in causes if k in named or (k in known and k not in waves)]
    return tuple(dict.fromkeys((*stay, *usual, *(c.key for c in tables))))


@dataclass(frozen=True, slots=True)
class _AllRows:
    """A set of candidates fitted to all rows that are sound.

    moved: by key (n, 3) [m]; size: (n,) what is left of each row, in the usual one of the sound;
    gross: (n,) faults that are plain.
    """

    of: Posterior
    moved: Mapping[str, FloatArray]
    size: FloatArray
    gross: BoolArray

    def beside(self, written: Sequence[str]) -> FloatArray:
        """Return what all but the frames and some candidates move the readings by (n, 3) [m]."""
        total = np.zeros((len(self.size), 3))
        for key, moved in self.moved.items():
            if self.of.candidate(key).sort is not Sort.FRAME and key not in written:
                total += moved
        return total

    def faults(self) -> BoolArray:
        """Return (n,) the rows that are measuring faults."""
        bad: BoolArray = self.size > _FAULT
        sound = ~self.gross
        if bad[sound].mean() > _MOST_FAULTS:
            bad &= self.size > np.quantile(self.size[sound], 1.0 - _MOST_FAULTS)
        return np.asarray(bad | self.gross)


def _all_rows(judged: Judged, whole: Optimum) -> _AllRows:
    """Return a set at its scales, on all rows."""
    of, problem = judged.posterior, judged.posterior.problem
    n = len(problem)
    free = free_of(of, [k for k in whole.keys if _has_effect(of.candidate(k))], whole)
    gross = gross_faults(problem.gap)
    rows = np.flatnonzero(thinned(~gross))
    inside = problem.searchable[rows]
    in_search = of.moved(whole, [k for k in whole.keys if not _has_effect(of.candidate(k))])
    place = np.full(n, -1)
    place[of.at.index] = np.arange(len(of.at.index))
    weight = np.where(inside, of.weight[place[rows]], 0.0)
    measured = problem.measured[rows] - in_search[place[rows]]
    by = problem.by(weight / whole.sigma, rows)
    found = fit(problem.samples.rows(rows), measured, by, problem.given, free)
    at = Linearised.at(problem, np.arange(n), found.states)
    candidates = [_at(c, at, judged) for c in map(of.candidate, whole.keys)]
    weight = np.zeros(n)
    weight[rows] = 1.0
    for _ in range(2):
        equations = Equations.of(candidates, at.z, row_roots(problem, np.arange(n), weight))
        here = optimum(equations, whole.keys, of.prior, whole, held=True)
        moved = {c.key: c.X @ here.theta[here.part(equations, c.key)] for c in candidates}
        rest = at.z - sum(moved.values(), np.zeros_like(at.z))
        size = problem.size(rest)
        # few rows beside many numbers lie closer to the fit than they scatter
        level = max(here.sigma, of.level.sigma if of.level.known else 0.0)
        sigma = max(robust_sigma(size[~gross]), level)
        weight = np.where(weight > 0.0, student(size / sigma), 0.0)
    return _AllRows(of, moved, size / sigma, gross)


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
