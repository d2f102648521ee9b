"""What the chosen model says of single joints: stiffness, interval, how well it is seen.

One constant for all postures is no estimate where stiffness varies: then the number is the inverse
of the mean compliance over the measured postures, of the field that was chosen.
"""

from __future__ import annotations

import math

from postproc.arrays import FloatArray
from postproc.records import dataclass
from postproc.stiffness.identify.cases import LoadCases
from postproc.stiffness.identify.constant import ConstantFit
from postproc.stiffness.identify.continuous import ContinuousFit
from postproc.stiffness.identify.observability import Visibility, grade_by


@dataclass(frozen=True, slots=True)
class JointEstimate:
    """Stiffness [N*m/rad] and its interval (NaN unseen, high may be infinite), sd over size."""

    stiffness: float
    low: float
    high: float
    relative_sd: float
    grade: Visibility


UNSEEN_JOINT = JointEstimate(math.nan, math.nan, math.nan, math.inf, Visibility.UNOBSERVABLE)


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
