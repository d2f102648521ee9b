"""Routines and functions of a delivered controller that matter for motion: those of the forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from postproc.controller.runtime import UNKNOWN, component
from postproc.krl import Aggregate, initial_values, system_variable
from postproc.records import dataclass
from postproc.units import PERCENT

_SILENT = """
IR_STOPM SET_CD_PARAMS SPTP_OUT CWRITE CREAD SWRITE SREAD MSGNOTIFY MSGDIALOG MSGQUIT VARSTATE
ERR_CLEAR RSITECHIDLE
"""
SILENT = frozenset(_SILENT.split())
"""Routines of the controller that neither move the robot nor belong to the process."""


_QUIET = """
SIGNAL STRUC ENUM IMPORT CHANNEL ANOUT CONFIRM COPEN CCLOSE CREAD CWRITE SREAD SWRITE
"""
QUIET = frozenset(_QUIET.split())
"""Instructions without brackets, by their first word, that neither move the robot nor change how
it moves: declarations, outputs, channels."""
DECLARING = frozenset({"SIGNAL", "STRUC", "ENUM", "IMPORT", "CHANNEL"})
"""Those of them that do nothing when they are run."""
READING = frozenset({"COPEN", "CREAD", "CWRITE", "SREAD", "SWRITE"})
"""Instructions that write into the variables they are given."""
CONTACT_ROUTINE = "SET_CD_PARAMS"
"""Of collision detection: forms call it with 0 or nothing; other numbers change the supervision."""
COMMAND_CHANNEL = "$CMD"
"""Who writes to this channel gives commands to the controller, such as to run a program."""


def is_still(name: str) -> bool:
    """Return whether a system variable moves no arm and changes no motion, whatever its index."""
    variable = system_variable(name.upper())
    return variable is not None and variable.effect.is_still


@dataclass(frozen=True, slots=True)
class NumberedFrame:
    """A tool, base or load selected by number in a ``WITH`` (``STOOL2``, ``SBASE``, ``SLOAD``)."""

    number: Any


def _data(arguments: list[Any]) -> Any:  # noqa: ANN401 - a KRL value
    return arguments[0] if arguments else UNKNOWN


def _path_speed(arguments: list[Any]) -> Any:  # noqa: ANN401
    return Aggregate((("CP", arguments[0]),)) if arguments else UNKNOWN


def _tool(arguments: list[Any]) -> Any:  # noqa: ANN401
    fdat = _data(arguments)
    number = component(fdat, "TOOL_NO") if isinstance(fdat, Aggregate) else fdat
    return NumberedFrame(number)


def _base(arguments: list[Any]) -> Any:  # noqa: ANN401
    return NumberedFrame(_data(arguments))


def _part(name: str) -> Callable[[list[Any]], Any]:
    """Return a function that gives a component of a PDAT or LDAT, or the value itself."""

    def part(arguments: list[Any]) -> Any:  # noqa: ANN401
        value = _data(arguments)
        return component(value, name) if isinstance(value, Aggregate) else value

    return part


def _path_acceleration(arguments: list[Any]) -> Any:  # noqa: ANN401
    value = _data(arguments)
    if isinstance(value, Aggregate) and value.get("ACC") is None:
        return value
    share = component(value, "ACC")
    if isinstance(share, int | float):
        value = float(initial_values()["$ACC.CP"]) * PERCENT * share
    return Aggregate((("CP", value),))


def _nothing(_arguments: list[Any]) -> Any:  # noqa: ANN401
    return UNKNOWN


_FUNCTIONS: dict[str, Callable[[list[Any]], Any]] = {
    "SVEL_JOINT": _data,
    "SVEL_CP": _path_speed,
    "STOOL": _tool,
    "STOOL2": _tool,
    "SBASE": _base,
    "SAPO": _data,
    "SAPO_PTP": _data,
    "SAPO_CP": _data,
    "SLOAD": _tool,
    "SACC_JOINT": _part("ACC"),
    "SACC_CP": _path_acceleration,
    "SIPO_MODE": _data,
    "SORI_TYP": _part("ORI_TYP"),
    "SGEAR_JERK": _part("GEAR_JERK"),
    "SJERK": _part("JERK_FAC"),
    "USE_CM_PRO_VALUES": _nothing,
}


def predefined(name: str) -> Callable[[list[Any]], Any] | None:
    """Return a function of the controller by name, None if it is none of those known."""
    return _FUNCTIONS.get(name.upper())
