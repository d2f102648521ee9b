"""Slips in the loads of a campaign: a sign that is reversed, forces in kilonewtons.

Springs give way along the load. Where no set of them explains the responses, and one does so once a
sign is turned, the sign is the fault; no stiffness would be the arm's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import SourceRef, StiffnessError
from postproc.measurement import WRENCH, MeasurementSet
from postproc.records import dataclass
from postproc.stiffness.identify.cases import LoadCases
from postproc.units import MM

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
