"""Joint stiffness from a measuring campaign: fit, choose the model by held-out error, judge it.

The winner is the simplest model whose error on tags that it has not seen lies within one standard
error of the best.

Springs give way along the load: where no set of them explains the responses, and one does so once a
sign is turned, the sign is the fault. One constant for all postures is no estimate where stiffness
varies: then the number is the inverse of the mean compliance over the measured postures.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import SourceRef, StiffnessError
from postproc.kinematics import Kinematics
from postproc.measurement import (
    MEAN_LENGTH,
    WRENCH,
    MeasurementSet,
    Remark,
    fit_registration,
    unloaded_rows,
)
from postproc.model import Registration
from postproc.progress import Progress
from postproc.records import dataclass
from postproc.stiffness.field import StiffnessField
from postproc.stiffness.fieldfile import describe
from postproc.stiffness.identify.cases import LoadCases, load_cases
from postproc.stiffness.identify.constant import ConstantFit
from postproc.stiffness.identify.continuous import ContinuousFit
from postproc.stiffness.identify.gridded import GridFit
from postproc.stiffness.identify.models import METHODS, IdentifyOptions, Models, ModelScore
from postproc.stiffness.identify.observability import (
    ShowingLoad,
    Visibility,
    grade_by,
    showing_load,
)
from postproc.units import MM

FEWEST_RESPONSES = 3

_EXPLAINED = 0.5
"""Share of the usual response that springs leave at most where the loads are right."""
_BETTER = 0.3
"""Share of that rest which another sign may leave at most to be the right one."""
_SOFTEST = 5.0 / MM
"""Stiffness [N/m] at the tool point below which no industrial arm is."""
_GROSS = 10.0
"""Responses so many times the usual one are faults."""
_SIGNS = {"all loads": WRENCH, **{name: (name,) for name in WRENCH[:3]}}
"""What may have been written with the wrong sign, and its columns."""


@dataclass(frozen=True, slots=True)
class _Springs:
    """Usual length [m] of the responses, and of what the best springs leave of them."""

    moved: float
    left: float


@dataclass(frozen=True, slots=True)
class JointEstimate:
    """Stiffness [N*m/rad] and its interval (NaN unseen, high may be infinite), sd over size."""

    stiffness: float
    low: float
    high: float
    relative_sd: float
    grade: Visibility


UNSEEN_JOINT = JointEstimate(math.nan, math.nan, math.nan, math.inf, Visibility.UNOBSERVABLE)


@dataclass(frozen=True, slots=True)
class Identification:
    """What was identified and how far it can be trusted.

    ``field`` is the chosen model, ``joints`` what it says of each; ``constant`` stands beside it;
    ``deflection_mean`` and ``_max`` [m]: what the loads did before any model.
    """

    chosen: str
    joints: tuple[JointEstimate, ...]
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
    remarks: tuple[Remark, ...] = ()

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
            method asked for, STF015 unknown method, STF016 and STF017 loads that cannot be right,
            STF018 no model is better than a rigid arm.
        DataError: MEA012 too few postures for the registration.
    """
    wanted = options or IdentifyOptions()
    if wanted.method not in METHODS:
        raise StiffnessError("STF015", f"method {wanted.method!r}, known are {', '.join(METHODS)}")
    report = progress or (lambda done, total, what: None)
    source = SourceRef(measured.path)
    registration = _registration(measured, kinematics, p_flange_tcp) if wanted.register else None
    everything = load_cases(measured, kinematics, p_flange_tcp, registration)
    if len(everything) < FEWEST_RESPONSES:
        raise StiffnessError(
            "STF014",
            f"{len(everything)} load responses, expected at least {FEWEST_RESPONSES}",
            source,
        )
    require_right_loads(
        measured,
        everything,
        lambda other: load_cases(other, kinematics, p_flange_tcp, registration),
    )
    faults = Models.of(everything, wanted, k_expected, source).faults()
    cases = everything.rows(~faults)
    models = Models.of(cases, wanted, k_expected, source)
    held_out = models.held_out(report)
    scores = models.scores(held_out)
    chosen, reason = _choose(scores, wanted)
    moved = np.linalg.norm(cases.d * cases.scale[:, None], axis=1)
    _require_use(next(s for s in scores if s.name == chosen), float(moved.mean()), source)
    return Identification(
        chosen=chosen,
        joints=_estimates(models, chosen),
        reason=reason,
        field=models.fitted(chosen),
        cases=cases,
        constant=models.constant,
        scores=scores,
        grids=models.grids,
        continuous=models.continuous,
        outliers=tuple(everything.ids[i] for i in np.flatnonzero(faults)),
        shown_by=_showing(cases, models.constant, kinematics, p_flange_tcp, measured),
        registration=registration,
        deflection_mean=float(moved.mean()),
        deflection_max=float(moved.max()),
        held_out_error=held_out[chosen],
        remarks=measured.remarks,
    )


def _require_use(score: ModelScore, moved: float, source: SourceRef) -> None:
    """Refuse a model that predicts what it has not seen no better than a rigid arm does."""
    if score.held_out_mean >= moved:
        raise StiffnessError(
            "STF018",
            f"on tags not fitted the best model is {score.held_out_mean / MM:.4f} mm off, a rigid "
            f"arm {moved / MM:.4f} mm: no stiffness can be identified",
            source,
            hint="check that each row has the load it was read under; read more "
            "postures, under larger loads",
        )


def _estimates(models: Models, chosen: str) -> tuple[JointEstimate, ...]:
    """Return what a model says of each joint."""
    constant = models.constant
    if chosen == "continuous" and models.continuous is not None:
        motion = constant.observability.motion * constant.centre / constant.c_ref
        return field_estimates(models.continuous, models.cases, motion, constant.confidence)
    observed = models.fitted(chosen).observed
    # a joint that varies too much for one constant, but not for the cells
    return tuple(
        replace(one, grade=Visibility.WEAK)
        if one.grade is Visibility.UNOBSERVABLE and is_seen
        else one
        for one, is_seen in zip(constant_estimates(constant), observed, strict=True)
    )


def _registration(
    measured: MeasurementSet, kinematics: Kinematics, p_flange_tcp: FloatArray
) -> Registration:
    rows = unloaded_rows(measured.q, measured.wrench)
    T_robroot_flange = kinematics.fk(measured.q[rows])
    return fit_registration(
        T_robroot_flange, measured.position[rows], p_flange_tcp, SourceRef(measured.path)
    )


def _choose(scores: tuple[ModelScore, ...], options: IdentifyOptions) -> tuple[str, str]:
    if options.method == "constant":
        return "constant", "asked for"
    if options.method == "continuous":
        return "continuous", "asked for"
    if options.method == "grid":
        asked = f"grid {options.grid / MM:g}" if options.grid else None
        if asked in [score.name for score in scores]:
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


def constant_estimates(fit: ConstantFit) -> tuple[JointEstimate, ...]:
    """Return the estimates of a constant fit."""
    found = []
    for joint, grade in enumerate(fit.observability.visibility):
        if grade is Visibility.UNOBSERVABLE:
            found.append(UNSEEN_JOINT)
            continue
        low, high = fit.stiffness_interval(joint)
        sd = float(fit.observability.relative_sd[joint])
        found.append(JointEstimate(1.0 / float(fit.c_joint[joint]), low, high, sd, grade))
    return tuple(found)


def field_estimates(
    fit: ContinuousFit, cases: LoadCases, motion: FloatArray, confidence: float
) -> tuple[JointEstimate, ...]:
    """Return the estimates of a field over the measured postures.

    Args:
        fit: of the field.
        cases: that were measured.
        motion: (6,) [m] that the loads move the tool by each joint.
        confidence: of the intervals.
    """
    from scipy.special import ndtri

    c = fit.field.compliance(cases.q).mean(axis=0)
    sd = fit.relative_sd(cases)
    reach = float(ndtri(0.5 + 0.5 * confidence)) * sd
    found = []
    for joint in range(6):
        if not fit.seen[joint]:
            found.append(UNSEEN_JOINT)
            continue
        # readings are linear in compliances, not in stiffness
        k, spread = 1.0 / float(c[joint]), float(reach[joint])
        high = k / (1.0 - spread) if spread < 1.0 else math.inf
        grade = grade_by(float(sd[joint]), float(motion[joint]), fit.hyper.sigma)
        found.append(JointEstimate(k, k / (1.0 + spread), high, float(sd[joint]), grade))
    return tuple(found)


def require_right_loads(
    measured: MeasurementSet, cases: LoadCases, again: Callable[[MeasurementSet], LoadCases]
) -> None:
    """Refuse loads whose sign or unit cannot be right.

    Args:
        measured: the readings.
        cases: their load responses.
        again: load responses of other readings, made in the same way.

    Raises:
        StiffnessError: STF016 reversed loads, STF017 forces in kilonewtons.
    """
    source = SourceRef(measured.path, int(measured.line[0]))
    wrench = np.asarray(measured.wrench)
    now = _springs(cases)
    if now.left > _EXPLAINED * now.moved:
        tried = {what: again(_turned(measured, names)) for what, names in _SIGNS.items()}
        rest = {what: _springs(other).left for what, other in tried.items()}
        best = min(rest, key=lambda what: rest[what])
        if rest[best] < _BETTER * now.left:
            raise StiffnessError(
                "STF016",
                f"the tool moves against the loads: springs leave {now.left / MM:.3f} mm of "
                f"{now.moved / MM:.3f}, with the sign of {best} reversed {rest[best] / MM:.3f} mm",
                source,
                hint="fx_N .. mz_Nm act ON the tool, in the axes of the robot root: a weight that "
                "hangs from it has fz_N below 0",
            )
        return
    force = np.linalg.norm(wrench[:, :3], axis=1)
    pushed = float(np.median(force[force > 0.0])) if np.any(force) else np.inf
    if cases.paired and pushed < _SOFTEST * now.moved:
        raise StiffnessError(
            "STF017",
            f"{pushed:.3g} N move the tool by {now.moved / MM:.3f} mm, no arm is that soft: "
            "forces in kilonewtons?",
            source,
            hint="give fx_N, fy_N, fz_N in newton and mx_Nm, my_Nm, mz_Nm in newton metres",
        )


def _turned(measured: MeasurementSet, names: tuple[str, ...]) -> MeasurementSet:
    sign = np.array([-1.0 if name in names else 1.0 for name in WRENCH])
    return replace(measured, wrench=np.asarray(measured.wrench) * sign)


def _springs(cases: LoadCases) -> _Springs:
    """Return how far springs, none of them negative, explain load responses."""
    from scipy.optimize import nnls

    length = np.linalg.norm(cases.d, axis=1)
    near = cases.rows(length <= _GROSS * max(float(np.median(length)), 1e-12))
    X, d = near.A.reshape(-1, 6), near.d.reshape(-1)
    size: FloatArray = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    # the triangle of a factorisation has all that the rows say of six numbers
    Q, R = np.linalg.qr(X / size)
    c = nnls(R, Q.T @ d)[0] / size
    left = np.linalg.norm(near.error(c), axis=1)
    moved = np.linalg.norm(near.d * near.scale[:, None], axis=1)
    return _Springs(float(np.median(moved)), float(np.median(left)))
