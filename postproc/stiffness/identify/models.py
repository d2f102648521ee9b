"""The models of joint stiffness that compete on one set of load responses, and how each does.

One constant per joint, one per cell of space (Jiao et al. 2022) in coarse to fine grids, and a
continuous function of the joint angles. Each is scored by its error on tags that it has not seen.
"""

from __future__ import annotations

import math
from dataclasses import field, replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.errors import SourceRef, StiffnessError
from postproc.progress import Progress
from postproc.records import dataclass
from postproc.stiffness.field import ConstantField, Grid, StiffnessField
from postproc.stiffness.fieldfile import describe
from postproc.stiffness.identify.cases import LoadCases
from postproc.stiffness.identify.constant import ConstantFit, fit_constant, outliers
from postproc.stiffness.identify.continuous import ContinuousFit, Hyper, fit_continuous
from postproc.stiffness.identify.gridded import GridFit, fit_grid, grid_over, members
from postproc.units import MM

METHODS = ("auto", "constant", "grid", "continuous")
FOLDS = 5
FEWEST_CASES = 9
"""Cases in the median cell below which a grid is not tried (the paper: more than ten a cell)."""
FEWEST_POSTURES = 12
"""Postures below which a continuous field is not tried."""
_LEAST, _MOST = 0.5, 0.999
"""Confidence that intervals may have."""


@dataclass(frozen=True, slots=True)
class IdentifyOptions:
    """How to identify.

    Args:
        method: one of ``METHODS``.
        grid: cell edge [m] for ``grid``; also the finest grid that ``auto`` compares.
        origin: (3,) lowest corner of the grid [m]; None: of the tool points.
        blend: run continuously between cell centres; False: the paper's rule.
        confidence: of the intervals.
        register: fit the tracker's frame and the reflector's place first.

    Raises:
        StiffnessError: STF026, STF028 if a number is none to reckon with.
    """

    method: str = "auto"
    grid: float | None = None
    origin: FloatArray | None = None
    blend: bool = True
    confidence: float = 0.9
    register: bool = False

    def __post_init__(self) -> None:
        """Refuse numbers that nothing can be reckoned with."""
        if self.grid is None and self.method == "grid":
            raise StiffnessError("STF026", "a model of the kind grid needs the edge of its cells")
        if self.grid is not None and not (math.isfinite(self.grid) and self.grid > 0.0):
            text = f"a grid of {self.grid / MM:g} mm, expected a positive edge"
            raise StiffnessError("STF026", text)
        if self.origin is not None and not np.isfinite(self.origin).all():
            raise StiffnessError("STF028", f"origin {self.origin / MM} mm, expected finite numbers")
        if not _LEAST <= self.confidence <= _MOST:
            text = f"a confidence of {self.confidence:g}, expected {_LEAST} to {_MOST}"
            raise StiffnessError("STF028", text)


@dataclass(frozen=True, slots=True)
class ModelScore:
    """How one model does: errors [m] of predicted displacement on held-out and on fitted cases.

    ``standard_error`` of the held-out mean against the best model's (paired over groups).
    """

    name: str
    text: str
    held_out_mean: float
    held_out_p95: float
    held_out_max: float
    standard_error: float
    fitted_mean: float
    fitted_max: float


@dataclass(slots=True)
class Models:
    """The fits of one set of cases, each made once.

    ``layouts``: the grids that compete, coarse to fine, by name; ``with_field``: a continuous field
    competes; ``grids``, ``continuous``: fits made so far.
    """

    cases: LoadCases
    options: IdentifyOptions
    k_expected: FloatArray | None
    constant: ConstantFit
    layouts: dict[str, Grid]
    with_field: bool
    grids: dict[str, GridFit] = field(default_factory=dict)
    continuous: ContinuousFit | None = None

    @classmethod
    def of(
        cls,
        cases: LoadCases,
        options: IdentifyOptions,
        k_expected: FloatArray | None,
        source: SourceRef,
    ) -> Models:
        """Return the models that the number of cases allows.

        Raises:
            StiffnessError: STF012 nothing to see, STF014 too few for the method asked for.
        """
        enough = len(np.unique(cases.posture)) >= FEWEST_POSTURES
        if options.method == "continuous" and not enough:
            raise StiffnessError(
                "STF014",
                f"{len(cases)} load responses are too few for a continuous stiffness, "
                f"expected at least {FEWEST_POSTURES} postures",
                source,
            )
        constant = fit_constant(cases, k_expected, options.confidence)
        with_field = options.method in ("auto", "continuous") and enough
        return cls(cases, options, k_expected, constant, _layouts(cases, options), with_field)

    @property
    def names(self) -> list[str]:
        """The models that compete, simplest first."""
        return ["constant", *self.layouts, *(["continuous"] if self.with_field else [])]

    def faults(self) -> BoolArray:
        """Return the cases (n,) that are measuring faults, by the finest model at hand."""
        field = self.fitted(self.names[-1])
        return outliers(self.cases, field.compliance(self.cases.q, self.cases.point))

    def fitted(self, name: str) -> StiffnessField:
        """Return a fitted field by the name of its model."""
        if name == "constant":
            return ConstantField(self.constant.c_joint)
        if name == "continuous":
            if self.continuous is None:
                self.continuous = fit_continuous(self.cases, self.constant)
            return self.continuous.field
        if name not in self.grids:
            grid = self.layouts[name]
            self.grids[name] = fit_grid(self.cases, grid, self.constant, self.options.blend)
        return self.grids[name].field

    def held_out(self, progress: Progress) -> dict[str, FloatArray]:
        """Return the errors (n, 3) [m] of each model on the cases left out of its fit."""
        errors = {name: np.zeros((len(self.cases), 3)) for name in self.names}
        fold_of = folds(self.cases)
        total = int(fold_of.max()) + 1
        hyper: Hyper | None = None
        for fold in range(total):
            progress(fold, total, "held-out errors")
            out = fold_of == fold
            held = self.cases.rows(out)
            part = self._without(out)
            for name in self.names:
                if name == "continuous":
                    part.continuous = fit_continuous(part.cases, part.constant, hyper)
                    # eight numbers that hardly depend on which fifth is left out
                    hyper = part.continuous.hyper
                errors[name][out] = held.error(part.fitted(name).compliance(held.q, held.point))
        return errors

    def _without(self, out: BoolArray) -> Models:
        """Return the same models of the other cases; of all where those show nothing."""
        kept = self.cases if bool(np.all(out)) else self.cases.rows(~out)
        try:
            constant = fit_constant(kept, self.k_expected, self.options.confidence)
        except StiffnessError:
            kept, constant = self.cases, self.constant
        return replace(self, cases=kept, constant=constant, grids={}, continuous=None)

    def scores(self, held_out: dict[str, FloatArray]) -> tuple[ModelScore, ...]:
        """Return how each model does by its held-out errors."""
        best = min(held_out, key=lambda name: float(np.linalg.norm(held_out[name], axis=1).mean()))
        return tuple(self._score(name, held_out[name], held_out[best]) for name in self.names)

    def _score(self, name: str, held_out: FloatArray, best: FloatArray) -> ModelScore:
        cases = self.cases
        field = self.fitted(name)
        fitted = np.linalg.norm(cases.error(field.compliance(cases.q, cases.point)), axis=1)
        length = np.linalg.norm(held_out, axis=1)
        return ModelScore(
            name=name,
            text=describe(field),
            held_out_mean=float(length.mean()),
            held_out_p95=float(np.percentile(length, 95)),
            held_out_max=float(length.max()),
            standard_error=_grouped_error(length - np.linalg.norm(best, axis=1), cases),
            fitted_mean=float(fitted.mean()),
            fitted_max=float(fitted.max()),
        )


def _layouts(cases: LoadCases, options: IdentifyOptions) -> dict[str, Grid]:
    """Return the grids that compete, coarse to fine."""
    if options.method in ("constant", "continuous"):
        return {}
    found = {}
    for edge in _edges(cases.point, options):
        grid = grid_over(cases.point, edge, options.origin)
        asked = options.method == "grid" and edge == options.grid
        if asked or (len(grid) > 1 and _cases_per_cell(grid, cases.point) >= FEWEST_CASES):
            found[f"grid {edge / MM:g}"] = grid
    return found


def _edges(points: FloatArray, options: IdentifyOptions) -> list[float]:
    """Return cell edges [m], coarse to fine: the one asked for and its doubles, or halves."""
    span = float(np.max(points.max(axis=0) - points.min(axis=0)))
    if span < 1e-3:
        return [options.grid] if options.grid else []
    finest = options.grid or span / 16.0
    edges = [finest * 2.0**k for k in range(6) if finest * 2.0**k <= span * (1.0 + 1e-6)]
    if options.grid and options.grid not in edges:
        edges.append(options.grid)
    return sorted(edges, reverse=True)


def _cases_per_cell(grid: Grid, points: FloatArray) -> float:
    count = np.bincount(members(grid, points)[0], minlength=len(grid))
    return float(np.median(count))


def folds(cases: LoadCases) -> IntArray:
    """Return the fold (n,) of each case; a group is never split, groups are dealt at random.

    With a single group its postures are dealt instead.
    """
    labels = cases.group if len(np.unique(cases.group)) > 1 else cases.posture
    _, number = np.unique(labels, return_inverse=True)
    count = int(number.max()) + 1
    order = np.random.default_rng(0).permutation(count)
    fold = np.empty(count, dtype=np.int64)
    fold[order] = np.arange(count) % max(min(FOLDS, count), 1)
    return np.asarray(fold[number], dtype=np.int32)


def _grouped_error(excess: FloatArray, cases: LoadCases) -> float:
    """Return the standard error of a mean whose groups are independent."""
    _, number = np.unique(cases.group, return_inverse=True)
    sums = np.bincount(number, excess - excess.mean())
    return float(np.sqrt(np.sum(sums**2))) / len(excess)
