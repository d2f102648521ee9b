"""Coordinate systems of CL files: which of them move the points, and how."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.arrays import FloatArray
from postproc.geometry import orthonormalised, rotation_x, rotation_y, rotation_z
from postproc.readers.apt.dialect import AxisRule
from postproc.readers.apt.statement import Statement, bounded
from postproc.units import DEG

if TYPE_CHECKING:
    from postproc.readers.apt.state import AptState

AXIS_NORM_GAP = 1e-3
"""How far the length of a unit vector in a file may be from one."""
_FRAME_NUMBERS = 9
_MATRIX_NUMBERS = 12
_ROW = 4
_TILT_GAP = 1e-4
_ROUND_ANGLE = 1e-3 * DEG
_RADIAN_DIGITS = 0.51e-6
"""Rounding of an angle that is written with six decimals [rad]."""


def msys_statement(state: AptState, statement: Statement, line: int) -> None:
    """Handle MSYS/: origin, x axis, y axis of the points' system in the part (NX)."""
    numbers = _all_numbers(state, statement, line, _FRAME_NUMBERS)
    x, y = np.array(numbers[3:6]), np.array(numbers[6:9])
    R = _rotation(state, np.column_stack([x, y, np.cross(x, y)]), line, statement)
    state.set_frame(R, np.array(numbers[:3]) * state.scale)


def origin_statement(state: AptState, statement: Statement, line: int) -> None:
    """Handle ORIGIN/: origin, and perhaps x axis and z axis, in the part (CATIA)."""
    if len(statement.args) == 3:
        point = _all_numbers(state, statement, line, 3)
        state.set_frame(np.eye(3), np.array(point) * state.scale)
        return
    numbers = _all_numbers(state, statement, line, _FRAME_NUMBERS)
    x, z = np.array(numbers[3:6]), np.array(numbers[6:9])
    R = _rotation(state, np.column_stack([x, np.cross(z, x), z]), line, statement)
    state.set_frame(R, np.array(numbers[:3]) * state.scale)


def csys_statement(state: AptState, statement: Statement, line: int) -> None:
    """Handle CSYS/: 12 numbers by rows; the points do not move, column 3 is the tool axis."""
    numbers = _all_numbers(state, statement, line, _MATRIX_NUMBERS)
    matrix = np.array(numbers).reshape(3, _ROW)
    R = _rotation(state, matrix[:, :3], line, statement)
    if state.dialect.axis_rule is AxisRule.SETUP:
        state.set_axis(*R[:, 2].tolist())
    elif not np.allclose(matrix, np.eye(3, _ROW), atol=1e-9):
        state.faults.warn(
            "APT160", "a CSYS that is not the identity: the points are taken as they stand", line
        )


def tool_axis_statement(state: AptState, statement: Statement, line: int) -> None:
    """Handle TLAXIS/: the tool axis of the points that follow, in their own system."""
    numbers = _all_numbers(state, statement, line, 3)
    i, j, k = unit_axis(state, numbers, line)
    if state.dialect.setup_plane:
        state.table.tilt_axis = np.array([i, j, k])
        state.table.reset(state)
    else:
        state.set_axis(i, j, k)


def unit_axis(state: AptState, numbers: list[float], line: int) -> tuple[float, float, float]:
    """Return a tool axis of length one.

    Raises:
        ReadError: APT026 for a zero vector, APT027 for another length, unless recovering.
    """
    length = float(np.linalg.norm(numbers))
    if length < AXIS_NORM_GAP:
        raise state.faults.error("APT026", "the tool axis is a zero vector", line)
    if abs(length - 1.0) > AXIS_NORM_GAP:
        state.faults.fix(
            "APT027",
            f"the tool axis has length {length:.4f}, expected 1",
            "its direction is taken",
            line,
        )
    i, j, k = (value / length for value in numbers)
    return i, j, k


def table_statement(state: AptState, statement: Statement, line: int) -> None:
    """Handle ROTABL/angle,AAXIS,TABLE,CCLW: radians that tilt the setup plane (CAMWorks).

    Raises:
        ReadError: APT060 if it is written otherwise.
    """
    words = statement.upper
    angle = bounded(words[0]) if words else None
    turn = {"AAXIS": rotation_x, "BAXIS": rotation_y, "CAXIS": rotation_z}.get(
        words[1] if len(words) > 1 else ""
    )
    if angle is None or turn is None:
        raise state.faults.error(
            "APT060", "ROTABL needs an angle and AAXIS, BAXIS or CAXIS", line, statement.text
        )
    sign = -1.0 if "CLW" in words[2:] else 1.0
    state.table.rotate(state, turn(sign * _unrounded(angle)), line)


def _unrounded(angle: float) -> float:
    """Return an angle [rad] of six decimals as the round number of degrees it stands for."""
    round_angle = round(angle / _ROUND_ANGLE) * _ROUND_ANGLE
    return round_angle if abs(angle - round_angle) <= _RADIAN_DIGITS else angle


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

    def reset(self, state: AptState) -> None:
        """Begin a feature with the table untilted."""
        if not np.array_equal(self.R, np.eye(3)):
            self.R = np.eye(3)
            state.set_frame(np.eye(3), np.zeros(3))

    def rotate(self, state: AptState, R: FloatArray, line: int) -> None:
        """Tilt further."""
        self.R = self.R @ R
        if np.allclose(self.R, np.eye(3), atol=AXIS_NORM_GAP * 1e-3):
            self.R = np.eye(3)
        self._line = line
        state.set_frame(self.R, np.zeros(3))

    def check(self, state: AptState) -> None:
        """Compare the tilt with TLAXIS before points are taken.

        Raises:
            ReadError: APT061 if they disagree.
        """
        if self.tilt_axis is not None and not np.array_equal(self.R, np.eye(3)):
            gap = float(np.linalg.norm(self.R[:, 2] - self.tilt_axis))
            if gap > _TILT_GAP:
                raise state.faults.error(
                    "APT061", "ROTABL and TLAXIS do not give the same tool axis", self._line
                )
        self._line = 0


def _all_numbers(state: AptState, statement: Statement, line: int, count: int) -> list[float]:
    numbers = [value for value in statement.numbers() if value is not None]
    if len(numbers) != count or len(statement.args) != count:
        raise state.faults.error(
            "APT062", f"{statement.word} needs {count} numbers", line, statement.text
        )
    return numbers


def _rotation(
    state: AptState, R: FloatArray, line: int, statement: Statement | None = None
) -> FloatArray:
    """Return the nearest rotation of a matrix that is one up to rounding."""
    if float(np.abs(R.T @ R - np.eye(3)).max()) > AXIS_NORM_GAP or np.linalg.det(R) < 0.0:
        raise state.faults.error(
            "APT063",
            "axes that are not at right angles, not of length 1 or left-handed",
            line,
            statement.text if statement else "",
        )
    return R if np.array_equal(R.T @ R, np.eye(3)) else orthonormalised(R)


class MatrixComment:
    """CATIA's ``$$*CATIA0`` comment: a name line, then three comment rows of a 3x4 matrix."""

    def __init__(self) -> None:
        self._line = 0
        self._rows: list[list[float]] = []
        self._named = False

    @property
    def is_open(self) -> bool:
        """Whether rows are still to come."""
        return self._line > 0

    def begin(self, line: int) -> None:
        """Begin at a ``$$*CATIA0`` line."""
        self._line, self._rows, self._named = line, [], False

    def row(self, state: AptState, text: str) -> None:
        """Take a comment line; the third row of numbers sets the frame."""
        numbers = [bounded(part) for part in text.replace(",", " ").split()]
        if len(numbers) != _ROW or None in numbers:
            return
        self._rows.append([float(v) for v in numbers if v is not None])
        if len(self._rows) == 3:
            matrix = np.array(self._rows)
            line, self._line = self._line, 0
            R = _rotation(state, matrix[:, :3], line)
            state.set_frame(R, matrix[:, 3] * state.scale)

    def check_closed(self, state: AptState) -> None:
        """Complain if a statement comes before the third row.

        Raises:
            ReadError: APT064.
        """
        if self._line:
            raise state.faults.error(
                "APT064", "$$*CATIA0 is not followed by a 3x4 matrix in comments", self._line
            )
