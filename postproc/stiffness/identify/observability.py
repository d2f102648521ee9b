"""What a set of loads can tell about each joint, before and apart from any fit.

A joint compliance is seen when one standard deviation of its estimate is small against the
compliance itself. Joints are dropped one at a time, the least visible first, until all that stay
are visible: two joints that the loads turn alike cannot both be fitted, but one of them can.
"""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import BoolArray, FloatArray
from postproc.records import dataclass
from postproc.stiffness.cartesian import joint_torque
from postproc.units import UM

UNSEEN = 2.0
"""A joint whose estimate scatters by more than this many times its own size is left out."""
WEAK = 0.25
"""Above this relative scatter an estimate is called weak."""
FINEST = 1e-7
"""No reading is better than this [m]; keeps exact synthetic data from seeing rounding."""


class Visibility(StrEnum):
    """How well the loads show a joint."""

    GOOD = "good"
    WEAK = "weak"
    UNOBSERVABLE = "unobservable"


@dataclass(frozen=True, slots=True)
class Observability:
    """What the loads show.

    visibility: one per joint; relative_sd (6,): one sigma of the compliance over its reference,
    infinite where unseen; motion (6,): rms displacement of the tool point [m] that the joint's
    reference compliance makes under the loads; confounded: joints left out whose motion another
    joint imitates, with that joint (0-based); condition: of the scaled columns that stay.
    """

    visibility: tuple[Visibility, ...]
    relative_sd: FloatArray
    motion: FloatArray
    confounded: dict[int, int]
    condition: float

    @property
    def seen(self) -> BoolArray:
        """(6,) joints that can be fitted."""
        return np.array([v is not Visibility.UNOBSERVABLE for v in self.visibility])

    def without(self, joints: BoolArray) -> Observability:
        """Return the same with some joints (6,) marked as not observable."""
        marks = zip(self.visibility, joints, strict=True)
        return replace(
            self, visibility=tuple(Visibility.UNOBSERVABLE if lost else old for old, lost in marks)
        )


def observe(A: FloatArray, c_ref: FloatArray, sigma: float) -> Observability:
    """Judge what regressors can tell.

    Args:
        A: (n, 3, 6) regressor per unit compliance.
        c_ref: (6,) compliance [rad/(N*m)] of the size that is expected.
        sigma: sd of a component of a case [m].
    """
    scaled = A.reshape(-1, 6) * c_ref
    noise = max(sigma, FINEST)
    motion = np.sqrt(np.sum(scaled**2, axis=0) / len(A))
    kept = list(range(6))
    confounded: dict[int, int] = {}
    while kept:
        deviation = noise * _deviations(scaled[:, kept])
        worst = int(np.argmax(deviation))
        if deviation[worst] <= UNSEEN:
            break
        joint = kept.pop(worst)
        twin = _imitator(scaled, joint, kept, noise)
        if twin is not None:
            confounded[joint] = twin
    relative = np.full(6, np.inf)
    if kept:
        relative[kept] = noise * _deviations(scaled[:, kept])
    return Observability(
        visibility=tuple(
            grade_by(relative[i], motion[i], noise) if i in kept else Visibility.UNOBSERVABLE
            for i in range(6)
        ),
        relative_sd=relative,
        motion=motion,
        confounded=confounded,
        condition=_condition(scaled[:, kept]),
    )


def grade_by(relative_sd: float, motion: float, noise: float) -> Visibility:
    """Return how well a joint is seen that can be told from the others.

    Args:
        relative_sd: one sigma of its compliance over the compliance.
        motion: rms [m] by which it moves the tool under the loads.
        noise: sd of a component of a case [m].
    """
    # a motion far under the noise is visible only as the average of many rows, and any fault of
    # the model of its own size spoils it
    return Visibility.WEAK if relative_sd > WEAK or motion < noise else Visibility.GOOD


def _deviations(columns: FloatArray) -> FloatArray:
    """Return sqrt(diag((XᵀX)⁻¹)) by QR; infinite for a column that the others span."""
    size = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(size > 0.0, size, 1.0)
    _, s, vt = np.linalg.svd(unit, full_matrices=False)
    cut = s > 1e-9 * s[0] if s[0] > 0.0 else np.zeros(len(s), dtype=bool)
    spread = np.sqrt(np.sum((vt[cut] / s[cut, None]) ** 2, axis=0))
    lost = np.sum(vt[~cut] ** 2, axis=0) > 1e-12
    with np.errstate(divide="ignore"):
        return np.where(lost | (size == 0.0), np.inf, spread / np.where(size > 0.0, size, 1.0))


def _imitator(scaled: FloatArray, joint: int, kept: list[int], noise: float) -> int | None:
    """Return the kept joint that moves the tool most like a joint that is visible on its own."""
    column = scaled[:, joint]
    size = float(np.linalg.norm(column))
    if not kept or noise / max(size, 1e-300) > UNSEEN:
        return None
    others = scaled[:, kept]
    similar = np.abs(others.T @ column) / (np.linalg.norm(others, axis=0) * size)
    return kept[int(np.argmax(similar))]


def _condition(columns: FloatArray) -> float:
    if columns.shape[1] == 0:
        return float("inf")
    return float(np.linalg.cond(columns))


@dataclass(frozen=True, slots=True)
class ShowingLoad:
    """A load that would show a joint: unit force (3,) in robroot axes and what it does.

    ``motion``: rms displacement [m] by that joint alone under ``newton`` of force at the measured
    postures; ``relative_sd``: one sigma of the compliance if every measured posture were read
    again under that load.
    """

    direction: FloatArray
    newton: float
    motion: float
    relative_sd: float


def showing_load(
    jacobian: ArrayLike, joint: int, c_ref: FloatArray, sigma: float, newton: float
) -> ShowingLoad:
    """Return the best force direction for one joint at given postures.

    Args:
        jacobian: (n, 6, 6) at the tool point, robroot axes.
        joint: 0-based.
        c_ref: (6,) expected compliance [rad/(N*m)].
        sigma: sd of a case [m].
        newton: size of the force [N].
    """
    J = np.asarray(jacobian, dtype=np.float64)
    candidates = np.array(
        [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 0], [1, 0, 1], [0, 1, 1]], dtype=float
    )
    candidates /= np.linalg.norm(candidates, axis=1, keepdims=True)
    motions = []
    for force in candidates:
        torque = joint_torque(J, np.concatenate([newton * force, np.zeros(3)]))[:, joint]
        moved = c_ref[joint] * torque[:, None] * J[:, :3, joint]
        motions.append(float(np.sqrt(np.mean(np.sum(moved**2, axis=1)))))
    best = int(np.argmax(np.round(motions, 9)))  # ties go to the plain axis
    motion = motions[best]
    deviation = sigma / (motion * np.sqrt(len(J))) if motion > 0.0 else float("inf")
    return ShowingLoad(candidates[best], newton, motion, deviation)


def shown_text(load: ShowingLoad | None) -> str | None:
    """Return the load that would show a joint, in words; None for a joint that is seen."""
    if load is None:
        return None
    if load.motion < 1e-9:
        return "no force at the tool point; measure a point off the axis, under a moment"
    direction = " ".join(f"{v:.2g}" for v in load.direction)
    return (
        f"{load.newton:.0f} N along ({direction}) of the robot root: moves the tool "
        f"{load.motion / UM:.0f} um by this joint"
    )
