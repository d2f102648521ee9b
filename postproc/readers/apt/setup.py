"""Coordinate systems that take several lines of a CL file: tilted table, matrix in comments."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.geometry import orthonormalised
from postproc.readers.apt.statement import bounded
from postproc.readers.text import Faults

AXIS_NORM_GAP = 1e-3
"""How far the length of a unit vector in a file may be from one."""
ROW = 4
"""Numbers in a row of a 3x4 matrix."""
_TILT_GAP = 1e-4


def rotation(R: FloatArray, faults: Faults, line: int, text: str = "") -> FloatArray:
    """Return the nearest rotation of a matrix that is one up to rounding.

    Raises:
        ReadError: APT063 if it is none.
    """
    if float(np.abs(R.T @ R - np.eye(3)).max()) > AXIS_NORM_GAP or np.linalg.det(R) < 0.0:
        raise faults.error(
            "APT063",
            "axes that are not at right angles, not of length 1 or left-handed",
            line,
            text,
        )
    return R if np.array_equal(R.T @ R, np.eye(3)) else orthonormalised(R)


class TiltedTable:
    """The setup plane of CAMWorks: ROTABL by ROTABL, begun anew by TLAXIS or a feature's start.

    A feature may end without undoing its angles, so each start counts from the untilted table.
    """

    def __init__(self) -> None:
        self.R: FloatArray = np.eye(3)
        self.tilt_axis: FloatArray | None = None
        self._line = 0

    @property
    def is_moving(self) -> bool:
        """Whether ROTABL came since the tilt was last checked."""
        return self._line > 0

    def reset(self) -> bool:
        """Begin a feature with the table untilted; return whether it was tilted."""
        was_tilted = not np.array_equal(self.R, np.eye(3))
        self.R = np.eye(3)
        return was_tilted

    def rotate(self, R: FloatArray, line: int) -> None:
        """Tilt further."""
        self.R = self.R @ R
        if np.allclose(self.R, np.eye(3), atol=AXIS_NORM_GAP * 1e-3):
            self.R = np.eye(3)
        self._line = line

    def check(self, faults: Faults) -> None:
        """Compare the tilt with TLAXIS before points are taken.

        Raises:
            ReadError: APT061 if they disagree.
        """
        if self.tilt_axis is not None and not np.array_equal(self.R, np.eye(3)):
            gap = float(np.linalg.norm(self.R[:, 2] - self.tilt_axis))
            if gap > _TILT_GAP:
                raise faults.error(
                    "APT061", "ROTABL and TLAXIS do not give the same tool axis", self._line
                )
        self._line = 0


class MatrixComment:
    """CATIA's ``$$*CATIA0`` comment: a name line, then three comment rows of a 3x4 matrix."""

    def __init__(self) -> None:
        self._line = 0
        self._rows: list[list[float]] = []

    @property
    def is_open(self) -> bool:
        """Whether rows are still to come."""
        return self._line > 0

    def begin(self, line: int) -> None:
        """Begin at a ``$$*CATIA0`` line."""
        self._line, self._rows = line, []

    def row(self, text: str, faults: Faults) -> tuple[FloatArray, FloatArray] | None:
        """Take a comment line; the third row of numbers gives rotation and origin, as written."""
        numbers = [bounded(part) for part in text.replace(",", " ").split()]
        if len(numbers) != ROW or None in numbers:
            return None
        self._rows.append([float(v) for v in numbers if v is not None])
        if len(self._rows) < 3:
            return None
        matrix = np.array(self._rows)
        line, self._line = self._line, 0
        return rotation(matrix[:, :3], faults, line), matrix[:, 3]

    def check_closed(self, faults: Faults) -> None:
        """Complain if a statement comes before the third row.

        Raises:
            ReadError: APT064.
        """
        if self._line:
            raise faults.error(
                "APT064", "$$*CATIA0 is not followed by a 3x4 matrix in comments", self._line
            )
