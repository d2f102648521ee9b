"""A reading to take next, and where the arm may be sent for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.data import Samples
from postproc.kinematics import wrist_distance
from postproc.records import dataclass
from postproc.units import DEG, MM

APPROACH = 4.0 * DEG
"""Way of each joint before a reading, so that play in the gears is taken up on that side."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Where the arm may be sent; angles [rad].

    is_free: (n, 6) to (n,); are_free: two (n, 6) to (n,), the straight PTP between them.
    """

    joint_margin: float = 2.0 * DEG
    singularity: float = 5.0 * DEG
    is_free: Callable[[FloatArray], BoolArray] | None = None
    are_free: Callable[[FloatArray, FloatArray], BoolArray] | None = None

    def allows(self, samples: Samples, before: FloatArray) -> BoolArray:
        """Return (n,) poses that can be taken, coming from ``before`` (n, 6)."""
        kin, q = samples.arm.kinematics, samples.q
        good = kin.within_limits(q, self.joint_margin) & kin.within_limits(
            before, self.joint_margin
        )
        good &= wrist_distance(kin, q) >= self.singularity
        index = np.flatnonzero(good)
        if self.is_free is not None and len(index):
            index = index[self.is_free(q[index])]
        if self.are_free is not None and len(index):
            index = index[self.are_free(before[index], q[index])]
        out = np.zeros(len(q), dtype=bool)
        out[index] = True
        return out


@dataclass(frozen=True, slots=True)
class NextPose:
    """A reading to take.

    q (6,) [rad]; expected (3,) [m]: where the model expects the point, in the measured frame;
    wrench (6,) as in the rows, direction (6,) and temperature [degC] where the rows have them, qd
    (6,) [rad/s] where it is to be read in motion; separations: for each effect in question the
    separation [sigma] of its nearest rival by all poses of this reason, if it is the true one;
    revisit: it tells the noise, together with the readings of the same pose; id: name of the row.
    """

    q: FloatArray
    why: str
    expected: FloatArray
    wrench: FloatArray | None = None
    direction: FloatArray | None = None
    temperature: float | None = None
    qd: FloatArray | None = None
    separations: Mapping[str, float] = field(default_factory=dict)
    id: str = ""
    revisit: bool = False

    @property
    def separation(self) -> float:
        """The smallest separation [sigma], NaN without any."""
        return min(self.separations.values(), default=float("nan"))

    @property
    def before(self) -> FloatArray:
        """(6,) where the last motion to the pose starts [rad]."""
        return self.q if self.direction is None else self.q - self.direction * APPROACH

    def entry(self) -> dict[str, Any]:
        """Return the entry of the diagnosis, file units."""
        found: dict[str, Any] = {"id": self.id} if self.id else {}
        found |= {"q_deg": _plain(self.q / DEG, 5), "why": self.why}
        found["expected_mm"] = _plain(self.expected / MM, 3)
        if self.wrench is not None:
            found["force_N"] = _plain(self.wrench[:3], 1)
            found["moment_Nm"] = _plain(self.wrench[3:], 1)
        if self.direction is not None:
            found["approach"] = self.direction.astype(int).tolist()
        if self.temperature is not None:
            found["temp_C"] = round(self.temperature, 2)
        if self.qd is not None:
            found["qd_deg_s"] = _plain(self.qd / DEG, 3)
        if self.separations:
            found["separation_sigma"] = round(self.separation, 1)
            found["separation_if_sigma"] = {k: round(v, 1) for k, v in self.separations.items()}
        return found


def _plain(values: FloatArray, digits: int) -> list[float]:
    return [float(v) for v in np.round(values, digits) + 0.0]
