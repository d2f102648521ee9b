"""The diagnosis: which effects, how sure, what is left, and how far the gap shrinks."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.answers.shrinkage import Apart, Step, rms
from postproc.gap.data import Samples
from postproc.gap.fit import Fit, Noise, Problem, Wave, gross_faults
from postproc.gap.posterior import (
    Dependence,
    Judged,
    Name,
    Part,
    Sort,
    judged,
    posterior,
    servings,
    tolerated,
)
from postproc.progress import Progress
from postproc.records import dataclass

FEWEST = 4
"""Rows of a set that can be said to follow anything."""
_SURE = 1e-3
"""Probability by chance, over all columns looked at, below which a set follows one."""


@dataclass(frozen=True, slots=True)
class Followed:
    """What a set of rows follows: (n,) these rows, the class of it (None: nothing), the column."""

    rows: BoolArray
    part: str | None = None
    column: str = ""


def followed(problem: Problem, bad: BoolArray) -> Followed:
    """Return what rows (n,) that look like faults follow, gross ones aside."""
    bad = bad & ~gross_faults(problem.gap)
    count = int(bad.sum())
    none = Followed(np.zeros(len(bad), dtype=bool))
    if count < FEWEST or count > len(bad) // 2:
        return none
    told = []
    columns = list(_columns(problem.samples))
    for kind, name, values in columns:
        told.append((_chance(values, bad), kind, name))
    p, kind, name = min(told, default=(1.0, "", ""))
    if p * len(columns) > _SURE:
        return none
    return Followed(bad, kind, name)


def _columns(samples: Samples) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield class, name and values (n,) or (n, k) of everything logged that a set may follow."""
    if samples.wrench is not None:
        yield "load", "direction of the force", samples.wrench[:, :3]
        yield "load", "force", np.linalg.norm(samples.wrench[:, :3], axis=1)
    if samples.direction is not None:
        yield "approach", "dir", samples.direction
    if samples.qd is not None:
        yield "speed", "qd", samples.qd
    yield "time", "time", samples.course
    if samples.temperature is not None:
        yield "temperature", "temperature", samples.temperature
    for name, values in samples.extra.items():
        array = np.asarray(values)
        if array.dtype.kind in "fiu" and bool(np.all(np.isfinite(array))):
            yield "condition", name, array.astype(np.float64)


def _chance(values: FloatArray, bad: BoolArray) -> float:
    """Return the chance of a set so far to one side: ranks of a column, means of several."""
    from scipy.special import fdtrc
    from scipy.stats import mannwhitneyu

    if float(np.ptp(values)) <= 0.0:
        return 1.0
    one, other = values[bad], values[~bad]
    if values.ndim == 1:
        return float(mannwhitneyu(one, other, alternative="two-sided").pvalue)
    apart = one.mean(axis=0) - other.mean(axis=0)
    each = np.concatenate([one - one.mean(axis=0), other - other.mean(axis=0)])
    freedom, k = len(values) - 2, int(np.linalg.matrix_rank(each))
    if freedom <= k:
        return 1.0
    inverse = np.linalg.pinv(each.T @ each / freedom)
    square = float(apart @ inverse @ apart) * len(one) * len(other) / len(values)
    return float(fdtrc(k, freedom - k + 1, square * (freedom - k + 1) / (k * freedom)))


_LOUD = 1.5 * float(np.sqrt(3.0))
"""Rest of all rows that are no faults, 3D rms over the noise per axis, that is no noise: where many
rows lie far off, the fit looks past them."""


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Result of a diagnosis, SI. Rows refer to those of ``problem``.

    judged: names, and what the searched rows say of them; outlier: (n,) measuring faults;
    baseline: (n, 3) points of the given model with the registration [m]; fit: of all rows, points
    and frames those of the adopted effects; residual: (n, 3) [m]; steps; total: 3D rms [m] on rows
    left out, before and after all that the model holds, and the 90 % interval of the shrinkage;
    held: (k, 2) the same of each row kept [m]; sealed: the same two of the sealed rows, NaN without
    such; extra: for each effect not adopted the 3D
    rms [m] on places left out, without and with it; deviation: standard deviations (p,) of each
    adopted effect's numbers; suspects: (n,) rows far off that follow something logged: no faults;
    spread: by effect (d, p), how the numbers may be wrong together in usual sizes.
    """

    problem: Problem
    judged: Judged
    verdict: str
    outlier: BoolArray
    suspects: BoolArray
    adopted: tuple[str, ...]
    fit: Fit
    deviation: dict[str, FloatArray]
    baseline: FloatArray
    residual: FloatArray
    steps: tuple[Step, ...]
    total: tuple[float, float, float, float]
    held: FloatArray
    with_faults: tuple[float, float]
    sealed: tuple[float, float]
    extra: dict[str, tuple[float, float]]
    unexplained: tuple[Part, ...]
    ripple: tuple[Wave, ...]
    spread: dict[str, FloatArray]

    @property
    def level(self) -> Noise:
        """The noise and what it rests on."""
        return self.judged.posterior.level

    @property
    def noise(self) -> float:
        """Noise [m] per axis, as far as it is known; else what rows scatter by."""
        return self.level.sigma

    @property
    def tests(self) -> tuple[Dependence, ...]:
        """Tests of what the names leave."""
        return self.judged.tests

    @property
    def structure(self) -> float:
        """3D rms [m] of what is left and not noise."""
        return self.judged.structure

    @property
    def resembled(self) -> tuple[str, ...]:
        """Effects without a name of their own that the gap behaves like."""
        of = self.judged.posterior
        keys = self.judged.resembled
        return tuple(of.candidate(k).name for k in keys if of.candidate(k).effect is not None)

    @property
    def kept(self) -> BoolArray:
        """(n,) rows that are no measuring faults."""
        return ~self.outlier

    @property
    def serving(self) -> tuple[str, ...]:
        """Effects without a name that the model holds: they make it miss fresh rows by less."""
        fitted = self.fit.slices
        return tuple(n for n in fitted if n not in (*self.adopted, *self.problem.always))

    def withheld(self, accepted: Collection[str] = ()) -> tuple[str, ...]:
        """Return the adopted effects of the arm that no model holds: the instrument may be it.

        Args:
            accepted: names that are taken for the arm's all the same.
        """
        names = (n.name for n in self.judged.adopted if n.is_withheld)
        return tuple(name for name in names if name not in accepted)

    def name(self, name: str) -> Name:
        """Return an adopted name."""
        return next(n for n in self.judged.adopted if n.name == name)


def diagnose(problem: Problem, progress: Progress | None = None) -> Diagnosis:
    """Return the diagnosis of a campaign."""
    say = progress or (lambda done, total, what: None)
    say(0, 4, "noise and candidates")
    of = posterior(problem)
    problem = of.problem
    say(1, 4, "which effects")
    found = judged(of)
    say(2, 4, "what is left")
    served, bad = servings(found)
    told = followed(problem, bad)
    suspects = bad & told.rows
    say(3, 4, "rows left out")
    apart = Apart.best(served, ~bad | suspects)
    last = apart.last
    away = np.linalg.norm(problem.rest(apart.baseline), axis=1)
    residual = problem.rest(last.fit.point)
    verdict = found.verdict
    rest = found.rest
    kept = residual[~bad | suspects]
    most = np.hypot(_LOUD * found.sigma, tolerated(found.adopted, found.sigma))
    if found.posterior.level.known and rms(np.linalg.norm(kept, axis=1)) > most:
        verdict = "unexplained" if verdict in ("explained", "no_gap") else verdict
    if told.part is not None:
        size = float(np.sqrt(np.mean(np.sum((residual * suspects[:, None]) ** 2, axis=1))))
        rest = (*rest, Part(told.part, told.column, "some rows", size, float("nan")))
        verdict = "unexplained"
    return Diagnosis(
        problem=problem,
        judged=found,
        verdict=verdict,
        outlier=bad & ~suspects,
        suspects=suspects,
        adopted=tuple(step.name for step in apart.steps),
        fit=last.fit,
        deviation=last.deviations,
        baseline=apart.baseline,
        residual=residual,
        steps=apart.steps,
        total=apart.total,
        held=apart.held,
        with_faults=(rms(away), rms(np.linalg.norm(residual, axis=1))),
        sealed=apart.sealed,
        extra=_extra(found),
        unexplained=() if verdict in ("explained", "no_gap") else rest,
        ripple=_ripple(found) if verdict == "unexplained" else (),
        spread=last.spread,
    )


def _extra(found: Judged) -> dict[str, tuple[float, float]]:
    """Return what each further effect would do on places not fitted, to first order."""
    of = found.posterior
    label = of.problem.split.fold[of.at.index]
    named = {n.name for n in found.adopted} | set(of.problem.always)
    other: dict[str, str] = {}
    for c in of.search.equations.candidates:
        if c.sort is Sort.CAUSE and c.name not in named:
            other.setdefault(c.name, c.key)
    names = [k for n in found.adopted for k in n.keys]
    before = found.missed(names, label)
    return {name: (before, found.missed([*names, key], label)) for name, key in other.items()}


def _ripple(found: Judged) -> tuple[Wave, ...]:
    """Return the waves of joint angles that are in the posterior without a name."""
    of = found.posterior
    named = {k for n in found.adopted for k in n.keys}
    waves = [
        of.candidate(k)
        for k in found.whole.keys
        if k not in named and (e := of.candidate(k).effect) is not None and e.periodic
    ]
    return tuple(wave for c in waves for wave in (c.setting or {})["waves"])
