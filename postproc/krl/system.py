"""The one table of system variables, ``system.toml``: what each does, what it takes."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from enum import StrEnum
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from postproc.records import record

_INDEX = re.compile(r"\[[^\]]*\]")


class Effect(StrEnum):
    """What setting a variable does."""

    MOTION = "motion"
    FRAMES = "frames"
    LOAD = "load"
    SUPERVISION = "supervision"
    MACHINE = "machine"
    OUTPUT = "output"
    """Devices and other programs see it; the arm does not move by it."""
    HARMLESS = "harmless"
    READ_ONLY = "read-only"

    @property
    def is_still(self) -> bool:
        """Whether the arm neither moves nor is moved otherwise by it."""
        return self in (Effect.OUTPUT, Effect.HARMLESS)


@record(frozen=True, slots=True)
class SystemVariable:
    """One variable: ``name`` with its $ and components, without indices.

    ``type``: in upper case, empty where it is not known; ``size``: elements of an array, 0 where
    the controller decides, None for no array; ``least`` (``open``: no value itself), ``most``;
    ``initial``: after BAS(#INITMOV,0) of a delivered controller.
    """

    name: str
    effect: Effect
    does: str
    source: str
    type: str = ""
    size: int | None = None
    least: float | None = None
    open: bool = False
    most: float | None = None
    unit: str = ""
    initial: float | str | None = None
    constants: frozenset[str] = frozenset()

    def takes(self, value: float) -> bool:
        """Return whether a number is one of its values."""
        low, high = self.least, self.most
        above = low is None or value > low or (value == low and not self.open)
        return above and (high is None or value <= high) and (not self._counts or value % 1 == 0)

    @property
    def _counts(self) -> bool:
        """Whether a part of one would be none of its values; shares are rounded."""
        return self.type == "INT" and not self.unit

    @property
    def expected(self) -> str:
        """The numbers that it takes, in words."""
        whole = "a whole number" if self._counts else ""
        low = "" if self.least is None else f"{'above' if self.open else 'at least'} {self.least:g}"
        high = "" if self.most is None else f"at most {self.most:g}"
        return " and ".join(filter(None, (whole, low, high)))


@cache
def _listed() -> dict[str, Any]:
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))


@cache
def system_variables() -> Mapping[str, SystemVariable]:
    """Return all variables of the table by name."""
    found: dict[str, SystemVariable] = {}
    for row in _listed()["variables"]:
        values = {**row, "effect": Effect(row["effect"])}
        values["constants"] = frozenset(row.get("constants", "").split())
        for name in values.pop("names").split():
            found[f"${name}"] = SystemVariable(name=f"${name}", **values)
    return found


@lru_cache(maxsize=4096)
def system_variable(key: str) -> SystemVariable | None:
    """Return the variable that a reference in upper case means, or that it is a component of."""
    name, known = _INDEX.sub("", key), system_variables()
    while name not in known and "." in name:
        name = name.rpartition(".")[0]
    if name not in known and any(other.startswith(f"{name}.") for other in known):
        return next(v for v in known.values() if v.name.startswith(f"{name}."))
    return known.get(name)


@cache
def initial_values() -> Mapping[str, float | str]:
    """Return what BAS(#INITMOV,0) sets: every variable that is followed, arrays by element."""
    found: dict[str, float | str] = {}
    for name, variable in system_variables().items():
        if variable.initial is not None:
            size = variable.size
            keys = [name] if size is None else [f"{name}[{i}]" for i in range(1, size + 1)]
            found |= dict.fromkeys(keys, variable.initial)
    return found


@cache
def components_of() -> Mapping[str, frozenset[str]]:
    """Return the components of the structures that the table lists one by one, by name."""
    found: dict[str, frozenset[str]] = {}
    for name in system_variables():
        whole, dot, part = name.partition(".")
        if dot:
            found[whole] = found.get(whole, frozenset()) | {part}
    return found


@cache
def system_types() -> frozenset[str]:
    """Return the types that the kernel and the delivered data lists define."""
    return frozenset(_listed()["structures"].split())


@cache
def bas_commands() -> frozenset[str]:
    """Return the commands of BAS."""
    return frozenset(_listed()["bas"].split())
