"""Coordinate systems that take several lines of a CL file: tilted table, matrix in comments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.geometry import orthonormalised
from postproc.model import CamSetup
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


class SetupTable:
    """Distinct setups of a file, and from which line on each holds."""

    def __init__(self) -> None:
        self.setups: list[CamSetup] = []
        self._lines: list[int] = []
        self._calls: list[int] = []

    def call(self, setup: CamSetup) -> CamSetup:
        """Let a setup hold from its line on; return it as it was first seen."""
        same = [known.name == setup.name and _is_same(known, setup) for known in self.setups]
        index = same.index(True) if any(same) else len(self.setups)
        if index == len(self.setups):
            self.setups.append(setup)
        self._lines.append(setup.line)
        self._calls.append(index)
        return self.setups[index]

    def place(
        self, word: str, line: int, R: FloatArray, t: FloatArray, *, carried: bool, name: str = ""
    ) -> None:
        """Let a setup hold that the file places by ``p_part = R p_setup + t`` [m].

        One without a name is numbered among the places that the word gives it: ``MSYS_1``,
        ``MSYS_2``; a cell may call it ``MCS_2`` or ``2`` as well.
        """
        matrix = np.column_stack([R, t]) + 0.0
        setup = CamSetup(name, line, tuple(map(tuple, matrix.tolist())), carried)
        if not name:
            own = [known for known in self.setups if known.name.startswith(f"{word}_")]
            same = next((known for known in own if _is_same(known, setup)), None)
            number = f"{len(own) + 1}"
            name, aliases = f"{word}_{number}", (f"MCS_{number}", number)
            setup = same or replace(setup, name=name, aliases=aliases)
        self.call(replace(setup, line=line))

    def column(self, line: IntArray) -> IntArray | None:
        """Return the setup (n,) that holds at lines (n,), -1 before the first; None without any."""
        if not self.setups:
            return None
        calls = np.array([-1, *self._calls], dtype=np.int32)
        column: IntArray = calls[np.searchsorted(self._lines, line, side="right")]
        return column


def _is_same(a: CamSetup, b: CamSetup) -> bool:
    """Return whether two setups lie at one place, as far as the file says where."""
    if a.matrix is None or b.matrix is None:
        return a.matrix is b.matrix
    return a.carried == b.carried and np.allclose(a.matrix, b.matrix, rtol=0.0, atol=1e-9)


class MatrixComment:
    """CATIA's ``$$*CATIA0`` comment: a name line, then three comment rows of a 3x4 matrix."""

    def __init__(self) -> None:
        self._line = 0
        self._rows: list[list[float]] = []
        self.name = ""
        """What stands in front of the rows."""

    @property
    def is_open(self) -> bool:
        """Whether rows are still to come."""
        return self._line > 0

    def begin(self, line: int) -> None:
        """Begin at a ``$$*CATIA0`` line."""
        self._line, self._rows, self.name = line, [], ""

    def row(self, text: str, faults: Faults) -> tuple[FloatArray, FloatArray] | None:
        """Take a comment line; the third row of numbers gives rotation and origin, as written."""
        numbers = [bounded(part) for part in text.replace(",", " ").split()]
        if len(numbers) != ROW or None in numbers:
            self.name = self.name or text.strip()
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
