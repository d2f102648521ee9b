"""Coordinate systems of CL files: which of them move the points, and how."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.geometry import rotation_x, rotation_y, rotation_z
from postproc.model import CamSetup, WordClass
from postproc.readers.apt.refused import refuse
from postproc.readers.apt.setup import ROW, rotation
from postproc.readers.apt.state import AptState
from postproc.readers.apt.statement import Statement, bounded
from postproc.units import DEG

_FRAME_NUMBERS = 9
_MATRIX_NUMBERS = 12
_ROUND_ANGLE = 1e-3 * DEG
_RADIAN_DIGITS = 0.51e-6
"""Rounding of an angle that is written with six decimals [rad]."""


def msys_statement(state: AptState, statement: Statement) -> None:
    """Handle MSYS/: origin, x axis, y axis of the points' system in the part (NX)."""
    numbers = _all_numbers(state, statement, _FRAME_NUMBERS)
    x, y = np.array(numbers[3:6]), np.array(numbers[6:9])
    R = rotation(np.column_stack([x, y, np.cross(x, y)]), state.faults, state.line, statement.text)
    origin = np.array(numbers[:3]) * state.scale
    state.set_frame(R, origin)
    state.setups.place("MSYS", state.line, R, origin, carried=True)


def origin_statement(state: AptState, statement: Statement) -> None:
    """Handle ORIGIN/: origin, and perhaps x axis and z axis, in the part (CATIA).

    Other systems subtract it, or only say where their work origin lies: there it is refused unless
    it is zero.
    """
    count = 3 if len(statement.args) == 3 else _FRAME_NUMBERS
    numbers = _all_numbers(state, statement, count)
    R = np.eye(3)
    if count > 3:
        x, z = np.array(numbers[3:6]), np.array(numbers[6:9])
        R = rotation(
            np.column_stack([x, np.cross(z, x), z]), state.faults, state.line, statement.text
        )
    if not any(numbers[:3]) and np.array_equal(R, np.eye(3)):
        state.note("ORIGIN", WordClass.COORDINATES, "the origin is that of the points")
    elif not state.dialect.origin_moves:
        text = (
            "CATIA adds it to the points, PostWorks subtracts it, HSMWorks only names it; the "
            "points are taken as they stand"
        )
        hint = "--dialect catia if the points are to be moved by it"
        state.refuse("ORIGIN", WordClass.COORDINATES, text, hint)
        return
    origin = np.array(numbers[:3]) * state.scale
    state.set_frame(R, origin)
    state.setups.place("ORIGIN", state.line, R, origin, carried=True)


def mcsys_statement(state: AptState, statement: Statement) -> None:
    """Handle MCSYS/NUM,n,POINT,x,y,z,VECTOR,x axis,VECTOR,y axis (MfgSuite): a named setup."""
    words = [word for word in statement.upper if word not in {"NUM", "POINT", "VECTOR"}]
    numbers = _all_numbers(state, Statement("MCSYS", tuple(words), statement.text), 10)
    x, y = np.array(numbers[4:7]), np.array(numbers[7:10])
    _name_setup(state, "MCSYS", f"{numbers[0]:g}", x, y, numbers[1:4])


def mcs_statement(state: AptState, statement: Statement) -> None:
    """Handle MCS/x axis, y axis, z axis, origin (CAMplete, MANUSnc), and MCS2/ without origin."""
    count = _MATRIX_NUMBERS if statement.word == "MCS" else _FRAME_NUMBERS
    numbers = _all_numbers(state, statement, count)
    x, y = np.array(numbers[:3]), np.array(numbers[3:6])
    _name_setup(state, statement.word, statement.word, x, y, numbers[9:] or [0.0] * 3)


def _name_setup(
    state: AptState, word: str, name: str, x: FloatArray, y: FloatArray, origin: list[float]
) -> None:
    """Keep a setup that the file places; all but the identity is refused, no point is moved."""
    R = rotation(np.column_stack([x, y, np.cross(x, y)]), state.faults, state.line)
    matrix = np.column_stack([R, np.array(origin) * state.scale])
    rows = tuple(tuple((row + 0.0).tolist()) for row in matrix)
    setup = CamSetup(name, state.line, rows, aliases=(f"{word}_{name}",) if name != word else ())
    state.setups.call(setup)
    if not setup.is_identity:
        reason = (
            f"setup {name} lies elsewhere than the part's coordinates, and nothing says in which "
            "of the two the points are; they are taken as written"
        )
        state.refuse(word, WordClass.COORDINATES, reason)


def zero_statement(state: AptState, statement: Statement) -> None:
    """Handle ZERO/n (MANUSnc): the number of a work offset; one alone is the part's own."""
    (number,) = _all_numbers(state, statement, 1)
    name = f"{number:g}"
    offsets = {setup.name for setup in state.setups.setups if setup.matrix is None}
    state.setups.call(CamSetup(name, state.line, aliases=(f"ZERO_{name}",)))
    if offsets - {name}:
        reason = f"another work offset, {name}, whose place the file does not give"
        state.refuse("ZERO", WordClass.COORDINATES, reason)


def csys_statement(state: AptState, statement: Statement) -> None:
    """Handle CSYS/: 12 numbers by rows; the points do not move, column 3 is the tool axis."""
    numbers = _all_numbers(state, statement, _MATRIX_NUMBERS)
    matrix = np.array(numbers).reshape(3, ROW)
    R = rotation(matrix[:, :3], state.faults, state.line, statement.text)
    state.setups.place("CSYS", state.line, R, matrix[:, 3] * state.scale, carried=False)
    if state.dialect.axis_of_setup:
        state.set_axis(*R[:, 2].tolist())
    elif not np.allclose(matrix, np.eye(3, ROW), atol=1e-9):
        state.warn("APT160", "a CSYS that is not the identity: the points are taken as written")


def tool_axis_statement(state: AptState, statement: Statement) -> None:
    """Handle TLAXIS/: the tool axis of the points that follow, in their own system."""
    numbers = _all_numbers(state, statement, 3)
    (axis,) = state.unit_axes(np.array([numbers]), np.array([state.line]))
    if state.dialect.setup_plane:
        state.table.tilt_axis = axis
        untilt(state)
    else:
        state.set_axis(*axis.tolist())


def table_statement(state: AptState, statement: Statement) -> None:
    """Handle ROTABL/angle,AAXIS,TABLE,CCLW: radians that tilt the setup plane (CAMWorks).

    ROTATE, and ROTABL of others, turns a machine's table.
    """
    if not (state.dialect.setup_plane and statement.word == "ROTABL"):
        reason = "turns a table that the robot does not have"
        refuse(state, statement, WordClass.COORDINATES, reason)
        return
    words = statement.upper
    angle = bounded(words[0]) if words else None
    turn = {"AAXIS": rotation_x, "BAXIS": rotation_y, "CAXIS": rotation_z}.get(
        words[1] if len(words) > 1 else ""
    )
    if angle is None or turn is None:
        raise state.error("APT060", "ROTABL needs an angle and AAXIS, BAXIS or CAXIS")
    sign = -1.0 if "CLW" in words[2:] else 1.0
    state.table.rotate(turn(sign * _unrounded(angle)), state.line)
    state.set_frame(state.table.R, np.zeros(3))


def multax_statement(state: AptState, statement: Statement) -> None:
    """Handle MULTAX: a GOTO shows how many numbers it has; OFF may say where the axis is."""
    if "OFF" in statement.upper and state.dialect.off_is_upright:
        state.set_axis(0.0, 0.0, 1.0)


def translate_statement(state: AptState, statement: Statement) -> None:
    """Handle TRANS/x,y,z: a shift of the points by the postprocessor."""
    if any(statement.numbers()) or None in statement.numbers() or not statement.args:
        reason = "a shift of the points that this reader does not know to be made already or not"
        refuse(state, statement, WordClass.COORDINATES, reason)


def untilt(state: AptState) -> None:
    """Begin a feature with the table untilted."""
    if state.table.reset():
        state.set_frame(np.eye(3), np.zeros(3))


def _unrounded(angle: float) -> float:
    """Return an angle [rad] of six decimals as the round number of degrees it stands for."""
    round_angle = round(angle / _ROUND_ANGLE) * _ROUND_ANGLE
    return round_angle if abs(angle - round_angle) <= _RADIAN_DIGITS else angle


def _all_numbers(state: AptState, statement: Statement, count: int) -> list[float]:
    numbers = [value for value in statement.numbers() if value is not None]
    if len(numbers) != count or len(statement.args) != count:
        raise state.error("APT062", f"{statement.word} needs {count} numbers")
    return numbers
