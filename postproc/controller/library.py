"""Routines and functions of a delivered controller that matter for motion: those of the forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from postproc.controller.runtime import UNKNOWN, component
from postproc.krl import Aggregate
from postproc.records import dataclass

SILENT = frozenset(
    {
        "IR_STOPM",
        "SET_CD_PARAMS",
        "SPTP_OUT",
        "CWRITE",
        "CREAD",
        "SWRITE",
        "SREAD",
        "MSGNOTIFY",
        "MSGDIALOG",
        "MSGQUIT",
        "VARSTATE",
        "ERR_CLEAR",
        "RSITECHIDLE",
    }
)
"""Routines of the controller that neither move the robot nor belong to the process."""


QUIET = frozenset(
    {
        "SIGNAL",
        "STRUC",
        "ENUM",
        "IMPORT",
        "CHANNEL",
        "ANOUT",
        "CONFIRM",
        "COPEN",
        "CCLOSE",
        "CREAD",
        "CWRITE",
        "SREAD",
        "SWRITE",
    }
)
"""Instructions without brackets, by their first word, that neither move the robot nor change how
it moves: declarations, outputs, channels."""
READING = frozenset({"COPEN", "CREAD", "CWRITE", "SREAD", "SWRITE"})
"""Instructions that write into the variables they are given."""
CONTACT_ROUTINE, CONTACT_LIMITS = "SET_CD_PARAMS", "$COLLMON_TOL_PRO"
"""Of collision detection: forms call the first with 0 or nothing and take the configured values of
the second; other numbers change the supervision."""
COMMAND_CHANNEL = "$CMD"
"""Who writes to this channel gives commands to the controller, such as to run a program."""
HARMLESS = frozenset(
    {
        "$OUT",
        "$ANOUT",
        "$FLAG",
        "$CYCFLAG",
        "$TIMER",
        "$TIMER_STOP",
        "$BWDSTART",
        "$H_POS",
        "$LOOP_MSG",
        "$LOOP_CONT",
        "$COLLMON_TOL_PRO",
    }
)
"""System variables that neither move the robot nor change how it moves."""


def is_harmless(name: str) -> bool:
    """Return whether setting a system variable says nothing of the motion, whatever its index."""
    return name.upper().partition("[")[0].partition(".")[0] in HARMLESS


@dataclass(frozen=True, slots=True)
class NumberedFrame:
    """A tool, base or load selected by number in a ``WITH`` (``STOOL2``, ``SBASE``, ``SLOAD``)."""

    number: Any


def _speed(arguments: list[Any]) -> Any:  # noqa: ANN401 - a KRL value
    return arguments[0] if arguments else UNKNOWN


def _path_speed(arguments: list[Any]) -> Any:  # noqa: ANN401
    return Aggregate((("CP", arguments[0]),)) if arguments else UNKNOWN


def _tool(arguments: list[Any]) -> Any:  # noqa: ANN401
    fdat = arguments[0] if arguments else UNKNOWN
    number = component(fdat, "TOOL_NO") if isinstance(fdat, Aggregate) else fdat
    return NumberedFrame(number)


def _base(arguments: list[Any]) -> Any:  # noqa: ANN401
    return NumberedFrame(arguments[0] if arguments else UNKNOWN)


def _data(arguments: list[Any]) -> Any:  # noqa: ANN401
    return arguments[0] if arguments else UNKNOWN


def _ramp(arguments: list[Any]) -> Any:  # noqa: ANN401
    value = arguments[0] if arguments else UNKNOWN
    return component(value, "ACC") if isinstance(value, Aggregate) else value


def _path_acceleration(arguments: list[Any]) -> Any:  # noqa: ANN401
    value: Any = arguments[0] if arguments else UNKNOWN
    return value if isinstance(value, Aggregate) else Aggregate((("CP", value),))


def _orientation(arguments: list[Any]) -> Any:  # noqa: ANN401
    value = arguments[0] if arguments else UNKNOWN
    return component(value, "ORI_TYP") if isinstance(value, Aggregate) else value


def _nothing(_arguments: list[Any]) -> Any:  # noqa: ANN401
    return UNKNOWN


_FUNCTIONS: dict[str, Callable[[list[Any]], Any]] = {
    "SVEL_JOINT": _speed,
    "SVEL_CP": _path_speed,
    "STOOL": _tool,
    "STOOL2": _tool,
    "SBASE": _base,
    "SAPO": _data,
    "SAPO_PTP": _data,
    "SAPO_CP": _data,
    "SLOAD": _tool,
    "SACC_JOINT": _ramp,
    "SACC_CP": _path_acceleration,
    "SIPO_MODE": _data,
    "SORI_TYP": _orientation,
    "SGEAR_JERK": _data,
    "SJERK": _data,
    "USE_CM_PRO_VALUES": _nothing,
}


def predefined(name: str) -> Callable[[list[Any]], Any] | None:
    """Return a function of the controller by name, None if it is none of those known."""
    return _FUNCTIONS.get(name.upper())
