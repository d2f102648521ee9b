"""The choices of a cell's ``[krl]`` table, checked, with their defaults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from postproc.cell import Cell
from postproc.errors import EmitError, SourceRef
from postproc.krl import is_legal

HOOKS: Mapping[str, str] = {
    "spindle_on": "PP_SPINDLE_ON",
    "spindle_off": "PP_SPINDLE_OFF",
    "coolant_on": "PP_COOLANT_ON",
    "coolant_off": "PP_COOLANT_OFF",
    "stop": "PP_STOP",
    "optional_stop": "PP_OPTIONAL_STOP",
    "tool_change": "PP_TOOL_CHANGE",
}
"""Event to the routine that the integrator defines."""
MOTIONS = ("dense", "spline", "spline_block", "forms")
POINTS = ("inline", "dat")
FORMS = ("8.5", "8.6")
SPLITS = ("points", "operations")
ORIENTATION_SPEED_MAX = 400.0
"""$VEL_MA.ORI of a delivered controller [deg/s]; more stops the program."""
PATH_SPEED_MAX = 3.0
"""$VEL_MA.CP of a delivered controller [m/s]."""


@dataclass(frozen=True, slots=True)
class KrlStyle:
    """How programs are written; the meaning of each key stands in ``model.cellschema``."""

    motion: str = "dense"
    points: str = "inline"
    kss: str = "8.6"
    split: str = "points"
    advance: int = 3
    orientation_speed_deg_s: float = 200.0
    path_speed_max_m_s: float = 2.0
    cam_lines: bool = True
    setup: bool = False
    hooks_example: bool = False
    inertia_kg_m2: tuple[float, ...] | None = None
    hooks: Mapping[str, str] = field(default_factory=lambda: dict(HOOKS))

    @classmethod
    def of(cls, cell: Cell) -> KrlStyle:
        """Return the style of a cell.

        Raises:
            EmitError: EMT320 if a value is not one of those possible.
        """
        given = {
            key: value
            for key, value in cell.krl.options.items()
            if key in cls.__dataclass_fields__ and value is not None
        }
        hooks = {**HOOKS, **dict(given.pop("hooks", {}))}  # type: ignore[call-overload]
        inertia = given.pop("inertia_kg_m2", None)
        style = cls(
            **given,  # type: ignore[arg-type]
            hooks=hooks,
            inertia_kg_m2=None if inertia is None else tuple(inertia),  # type: ignore[arg-type]
        )
        style._check(SourceRef(cell.path))
        return style

    @property
    def is_spline(self) -> bool:
        """Whether all motions are the newer ones, which do not blend with the classic ones."""
        return self.motion in ("spline", "spline_block")

    def _check(self, source: SourceRef) -> None:
        choices = (
            ("motion", self.motion, MOTIONS),
            ("points", self.points, POINTS),
            ("kss", self.kss, FORMS),
            ("split", self.split, SPLITS),
        )
        for key, value, known in choices:
            if value not in known:
                raise _wrong(source, key, value, " or ".join(known))
        if not 0 <= self.advance <= 5:
            raise _wrong(source, "advance", self.advance, "0 to 5")
        for key, speed, largest in (
            ("orientation_speed_deg_s", self.orientation_speed_deg_s, ORIENTATION_SPEED_MAX),
            ("path_speed_max_m_s", self.path_speed_max_m_s, PATH_SPEED_MAX),
        ):
            if not 0.0 < speed <= largest:
                raise _wrong(source, key, speed, f"above 0 and at most {largest:g}")
        for key, name in self.hooks.items():
            if key not in HOOKS:
                raise _wrong(source, f"hooks.{key}", name, "one of " + ", ".join(HOOKS))
            if not is_legal(name):
                raise _wrong(source, f"hooks.{key}", name, "a KRL name of at most 24 characters")


def _wrong(source: SourceRef, key: str, value: object, expected: str) -> EmitError:
    return EmitError("EMT320", f"krl.{key}: {value!r}, expected {expected}", source)


def hook_names(cell: Cell) -> tuple[str, ...]:
    """Return the names of the routines that programs of this cell call and the integrator owns."""
    return tuple(KrlStyle.of(cell).hooks.values())
