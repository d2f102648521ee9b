"""Routines and functions of a delivered controller that matter for motion: those of the forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from postproc.controller.runtime import UNKNOWN, component
from postproc.krl import Aggregate

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


@dataclass(frozen=True, slots=True)
class NumberedFrame:
    """A tool or base selected by number in a ``WITH`` (``STOOL2``, ``SBASE``)."""

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
    "SLOAD": _nothing,
    "SACC_JOINT": _nothing,
    "SACC_CP": _nothing,
    "SIPO_MODE": _nothing,
    "SORI_TYP": _nothing,
    "SGEAR_JERK": _nothing,
    "SJERK": _nothing,
    "USE_CM_PRO_VALUES": _nothing,
}


def predefined(name: str) -> Callable[[list[Any]], Any] | None:
    """Return a function of the controller by name, None if it is none of those known."""
    return _FUNCTIONS.get(name.upper())
