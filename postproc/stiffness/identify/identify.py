"""Joint stiffness from a measuring campaign: fit, choose the model by held-out error, judge it.

Three kinds of model compete: one constant per joint, one per cell of space (Jiao et al. 2022), and
a continuous function of the joint angles. The winner is the simplest whose error on tags that it
has not seen lies within one standard error of the best.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.errors import SourceRef, StiffnessError
from postproc.kinematics import Kinematics
from postproc.measurement import MEAN_LENGTH, MeasurementSet, fit_registration, unloaded_rows
from postproc.model import Registration
from postproc.progress import Progress
from postproc.stiffness.field import ConstantField, Grid, StiffnessField
from postproc.stiffness.fieldfile import describe
from postproc.stiffness.identify.cases import LoadCases, load_cases
from postproc.stiffness.identify.constant import ConstantFit, fit_constant, outliers
from postproc.stiffness.identify.continuous import ContinuousFit, Hyper, fit_continuous
from postproc.stiffness.identify.gridded import GridFit, fit_grid, grid_over, members
from postproc.stiffness.identify.observability import ShowingLoad, Visibility, showing_load
from postproc.units import MM

METHODS = ("auto", "constant", "grid", "continuous")
FOLDS = 5
FEWEST_RESPONSES = 3
FEWEST_CASES = 9
"""Cases in the median cell below which a grid is not tried (the paper: more than ten a cell)."""
FEWEST_CONTINUOUS = 12
"""Cases below which a continuous field is not tried."""


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
    """

    method: str = "auto"
    grid: float | None = None
    origin: FloatArray | None = None
    blend: bool = True
    confidence: float = 0.9
    register: bool = False


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


@dataclass(frozen=True, slots=True)
class Identification:
    """What was identified and how far it can be trusted.

    ``field`` is the chosen model, ``mean`` (6,) the constant compliances beside it;
    ``deflection_mean`` and ``_max`` [m]: what the loads did before any model.
    """

    chosen: str
    reason: str
    field: StiffnessField
    cases: LoadCases
    constant: ConstantFit
    scores: tuple[ModelScore, ...]
    grids: dict[str, GridFit]
    continuous: ContinuousFit | None
    outliers: tuple[str, ...]
    shown_by: dict[int, ShowingLoad]
    registration: Registration | None
    deflection_mean: float
    deflection_max: float
    held_out_error: FloatArray

    @property
    def noise(self) -> float:
        """Sd per axis [m] of one reading: from repeats where there are any, else the residual."""
        floor = self.cases.floor
        if floor is not None and floor.dof >= 12:
            return floor.sigma
        left = [self.constant.sigma, *(fit.sigma for fit in self.grids.values())]
        return min([*left, *([self.continuous.hyper.sigma] if self.continuous else [])])

    @property
    def floor_mean(self) -> float:
        """Mean length [m] that pure noise gives the error of a whole load response."""
        return float(MEAN_LENGTH * self.noise * np.mean(self.cases.scale))

    @property
    def notes(self) -> tuple[str, ...]:
        """What a model file says of it in words."""
        first = f"joint stiffness identified from {len(self.cases)} load responses: {self.chosen}"
        return first, describe(self.field)


def identify(
    measured: MeasurementSet,
    kinematics: Kinematics,
    p_flange_tcp: FloatArray,
    options: IdentifyOptions | None = None,
    k_expected: FloatArray | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Identify joint stiffness.

    Args:
        measured: readings with loads.
        kinematics: nominal arm.
        p_flange_tcp: (3,) tool point in the flange [m].
        options: how.
        k_expected: (6,) [N*m/rad] expected stiffness; only its pattern helps.
        progress: called with (done, total, what).

    Raises:
        StiffnessError: STF010 no loads, STF012 nothing to see, STF014 too few cases for the
            method asked for, STF015 unknown method.
        DataError: MEA012 too few postures for the registration.
    """
    wanted = options or IdentifyOptions()
    if wanted.method not in METHODS:
        raise StiffnessError("STF015", f"method {wanted.method!r}, known are {', '.join(METHODS)}")
    report = progress or (lambda done, total, what: None)
    registration = _registration(measured, kinematics, p_flange_tcp) if wanted.register else None
    everything = load_cases(measured, kinematics, p_flange_tcp, registration)
    if len(everything) < FEWEST_RESPONSES:
        raise StiffnessError(
            "STF014",
            f"{len(everything)} load responses, expected at least {FEWEST_RESPONSES}",
            SourceRef(measured.path),
        )
    work = _Work(everything, wanted, k_expected, report, measured.path)
    cases, faults = work.without_faults()
    work = _Work(cases, wanted, k_expected, report, measured.path)
    scores, held_out = work.scores()
    chosen, reason = _choose(scores, wanted, work)
    constant = work.constant
    moved = np.linalg.norm(cases.d * cases.scale[:, None], axis=1)
    return Identification(
        chosen=chosen,
        reason=reason,
        field=work.field(chosen),
        cases=cases,
        constant=constant,
        scores=scores,
        grids=work.grids,
        continuous=work.continuous,
        outliers=tuple(everything.ids[i] for i in np.flatnonzero(faults)),
        shown_by=_showing(cases, constant, kinematics, p_flange_tcp, measured),
        registration=registration,
        deflection_mean=float(moved.mean()),
        deflection_max=float(moved.max()),
        held_out_error=held_out[chosen],
    )


def _registration(
    measured: MeasurementSet, kinematics: Kinematics, p_flange_tcp: FloatArray
) -> Registration:
    rows = unloaded_rows(measured.q, measured.wrench)
    T_robroot_flange = kinematics.fk(measured.q[rows])
    return fit_registration(
        T_robroot_flange, measured.position[rows], p_flange_tcp, SourceRef(measured.path)
    )


class _Work:
    """The fits of one set of cases, each made once."""

    def __init__(
        self,
        cases: LoadCases,
        options: IdentifyOptions,
        k_expected: FloatArray | None,
        report: Progress,
        path: str,
    ) -> None:
        self.cases = cases
        self.options = options
        self.k_expected = k_expected
        self.report = report
        self.constant = fit_constant(cases, k_expected, options.confidence)
        self.layouts = self._layouts(path)
        self.grids: dict[str, GridFit] = {}
        self.continuous: ContinuousFit | None = None
        self.with_field = self._wants_field(path)

    def without_faults(self) -> tuple[LoadCases, BoolArray]:
        """Return the cases without measuring faults, judged against the best model at hand."""
        if self.with_field:
            field: StiffnessField = fit_continuous(self.cases, self.constant).field
        else:
            field = ConstantField(self.constant.c_joint)
            finest = list(self.layouts)[-1:]
            if finest:
                field = self._fit_grid(finest[0]).field
        bad = outliers(self.cases, field.compliance(self.cases.q, self.cases.point))
        return self.cases.rows(~bad), bad

    def field(self, name: str) -> StiffnessField:
        """Return a fitted field by the name of its model."""
        if name == "constant":
            return ConstantField(self.constant.c_joint)
        if name == "continuous":
            if self.continuous is None:
                self.continuous = fit_continuous(self.cases, self.constant)
            return self.continuous.field
        if name not in self.grids:
            self.grids[name] = self._fit_grid(name)
        return self.grids[name].field

    def names(self) -> list[str]:
        """Return the models that compete, simplest first."""
        return ["constant", *self.layouts, *(["continuous"] if self.with_field else [])]

    def scores(self) -> tuple[tuple[ModelScore, ...], dict[str, FloatArray]]:
        """Return the score of each model and its held-out errors (n, 3) [m]."""
        names = self.names()
        held_out = {name: np.zeros((len(self.cases), 3)) for name in names}
        fold_of = _folds(self.cases)
        total = int(fold_of.max()) + 1
        hyper: Hyper | None = None
        for fold in range(total):
            self.report(fold, total, "held-out errors")
            out = fold_of == fold
            part = self._without(out)
            for name in names:
                if name == "continuous":
                    part.continuous = fit_continuous(part.cases, part.constant, hyper)
                    # eight numbers that hardly depend on which fifth is left out
                    hyper = part.continuous.hyper
                held = self.cases.rows(out)
                held_out[name][out] = held.error(part.field(name).compliance(held.q, held.point))
        best = min(names, key=lambda name: _mean_length(held_out[name]))
        return tuple(self._score(name, held_out, best) for name in names), held_out

    def _without(self, out: BoolArray) -> _Work:
        """Return the same work on the other cases; on all where those show nothing."""
        kept = self.cases if bool(np.all(out)) else self.cases.rows(~out)
        try:
            part = _Work(kept, self.options, self.k_expected, self.report, "")
        except StiffnessError:
            part = _Work(self.cases, self.options, self.k_expected, self.report, "")
        part.layouts = self.layouts
        return part

    def _score(self, name: str, held_out: dict[str, FloatArray], best: str) -> ModelScore:
        cases = self.cases
        field = self.field(name)
        fitted = np.linalg.norm(cases.error(field.compliance(cases.q, cases.point)), axis=1)
        length = np.linalg.norm(held_out[name], axis=1)
        excess = length - np.linalg.norm(held_out[best], axis=1)
        return ModelScore(
            name=name,
            text=describe(field),
            held_out_mean=float(length.mean()),
            held_out_p95=float(np.percentile(length, 95)),
            held_out_max=float(length.max()),
            standard_error=_grouped_error(excess, cases),
            fitted_mean=float(fitted.mean()),
            fitted_max=float(fitted.max()),
        )

    def _fit_grid(self, name: str) -> GridFit:
        return fit_grid(self.cases, self.layouts[name], self.constant, self.options.blend)

    def _layouts(self, path: str) -> dict[str, Grid]:
        """Return the grids that compete, coarse to fine."""
        points, options = self.cases.point, self.options
        if options.method in ("constant", "continuous") or path == "":
            return {}
        edges = _edges(points, options)
        found = {}
        for edge in edges:
            grid = grid_over(points, edge, options.origin)
            asked = options.method == "grid" and edge == options.grid
            if asked or (len(grid) > 1 and _cases_per_cell(grid, points) >= FEWEST_CASES):
                found[f"grid {edge / MM:g}"] = grid
        return found

    def _wants_field(self, path: str) -> bool:
        enough = len(np.unique(self.cases.posture)) >= FEWEST_CONTINUOUS
        if self.options.method == "continuous" and not enough:
            raise StiffnessError(
                "STF014",
                f"{len(self.cases)} load responses are too few for a continuous stiffness, "
                f"expected at least {FEWEST_CONTINUOUS} postures",
                SourceRef(path or "postproc"),
            )
        return self.options.method in ("auto", "continuous") and enough and path != ""


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


def _choose(
    scores: tuple[ModelScore, ...], options: IdentifyOptions, work: _Work
) -> tuple[str, str]:
    if options.method == "constant":
        return "constant", "asked for"
    if options.method == "continuous":
        return "continuous", "asked for"
    if options.method == "grid":
        asked = f"grid {options.grid / MM:g}" if options.grid else None
        if asked in work.layouts:
            return str(asked), "asked for"
        scores = tuple(score for score in scores if score.name.startswith("grid"))
        if not scores:
            raise StiffnessError("STF014", "too few load responses for any grid of cells")
    best = min(scores, key=lambda score: score.held_out_mean)
    for score in scores:
        if score.held_out_mean <= best.held_out_mean + score.standard_error:
            why = "smallest held-out error"
            if score is not best:
                why = f"within one standard error of {best.name} and simpler"
            return score.name, why
    return best.name, "smallest held-out error"


def _folds(cases: LoadCases) -> IntArray:
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


def _mean_length(errors: FloatArray) -> float:
    return float(np.mean(np.linalg.norm(errors, axis=1)))


def _grouped_error(excess: FloatArray, cases: LoadCases) -> float:
    """Return the standard error of a mean whose groups are independent."""
    _, number = np.unique(cases.group, return_inverse=True)
    sums = np.bincount(number, excess - excess.mean())
    return float(np.sqrt(np.sum(sums**2))) / len(excess)


def _showing(
    cases: LoadCases,
    constant: ConstantFit,
    kinematics: Kinematics,
    p_flange_tcp: FloatArray,
    measured: MeasurementSet,
) -> dict[int, ShowingLoad]:
    """Return, for each joint that is not well seen, the load that would show it."""
    forces = np.linalg.norm(np.asarray(measured.wrench)[:, :3], axis=1)
    newton = float(np.max(forces)) or 500.0
    first = np.unique(cases.posture, return_index=True)[1][:500]
    J = kinematics.jacobian(cases.q[first], p_flange_tcp)
    seen = constant.observability
    return {
        joint: showing_load(J, joint, constant.c_ref, constant.sigma, newton)
        for joint in range(6)
        if seen.visibility[joint] is not Visibility.GOOD
    }
