"""How far a program may be off its CAM file, and what became of the comparison of both."""

from __future__ import annotations

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.records import dataclass
from postproc.units import DEG, MM
from postproc.verification.cam.matching import Wanted
from postproc.verification.cam.real import RealPaths
from postproc.verification.report import Expectation


@dataclass(frozen=True, slots=True)
class Tolerances:
    """How far the program may be from the CAM file.

    ``position`` [m] of points, ``axis`` [rad] of the tool axis there, ``path`` [m] along arcs and
    lines beside the points; None: the chord tolerance of the cell.
    """

    position: float = 0.01 * MM
    axis: float = 0.005 * DEG
    path: float | None = None


@dataclass(slots=True)
class Comparison:
    """What the comparison found.

    ``served`` (n,): motion that goes to each tag, -1 for none; ``latest`` (n,): the last one that
    may be meant; ``is_cut`` (m,): motions that cut; ``milled`` (m,): those that
    serve lines and arcs; ``cut_of`` (m,): number of the cut that each belongs to, the way back of
    a hole with it, -1 for none; ``position_error`` (n,) [m], ``axis_error`` (n,) [rad] beyond the
    allowed tilt; ``tilt`` (n,) [rad] that was used of it; ``real``: the paths that were compared;
    ``nominal_error`` (n,) [m] of the commanded point, None without a model of the arm.
    """

    wanted: Wanted
    served: AnyIntArray
    latest: AnyIntArray
    is_cut: BoolArray
    milled: BoolArray
    cut_of: AnyIntArray
    position_error: FloatArray
    axis_error: FloatArray
    tilt: FloatArray
    real: RealPaths
    nominal_error: FloatArray | None = None

    def largest_shift(self) -> float:
        """Return how far [m] commands are at most off where the real tool works, 0 without one."""
        if self.nominal_error is None:
            return 0.0
        return float(self.nominal_error[self.served >= 0].max(initial=0.0))

    def expectation(self) -> Expectation | None:
        """Return the deviations of the real and of the commanded tool, None without a model."""
        if self.nominal_error is None:
            return None
        known = np.isfinite(self.position_error) & np.isfinite(self.nominal_error)
        values = [self.position_error[known], self.nominal_error[known]]
        both = [(float(v.max(initial=0.0)), _rms(v)) for v in values]
        return Expectation(*both[0], *both[1])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
