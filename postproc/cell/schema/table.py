"""What the tables of ``cell.toml`` are made of: kinds of values with their ranges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields, replace
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeVar, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, create_model, model_validator

from postproc.units import DEG, MEGABYTE, MM, MM_PER_MIN, MS, PERCENT, RPM

CHOICE = Field(strict=False)
"""A word of a list: the file holds text, the strict table would ask for the member itself."""
Length = Annotated[float, Field(ge=-1e5, le=1e5)]
Angle = Annotated[float, Field(ge=-360.0, le=360.0)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Size = Annotated[float, Field(gt=0.0, le=1e5)]
Vector = Annotated[list[Length], Field(min_length=3, max_length=3)]
Angles = Annotated[list[Angle], Field(min_length=3, max_length=3)]
SixPositive = Annotated[list[Positive], Field(min_length=6, max_length=6)]
AngleRange = Annotated[
    list[Annotated[float, Field(ge=-720.0, le=720.0)]], Field(min_length=2, max_length=2)
]
AxisName = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Text = Annotated[str, Field(min_length=1, max_length=255)]
EMPTY: Any = {}
"""A table of which no key is given, as a default. A table in its place would be built while the
schema loads, apart from that of the whole file."""
CamNames = list[Text | Annotated[int, Field(ge=0)]]


def entry(default: Any, meaning: str) -> Any:  # noqa: ANN401 - of any key
    """Return a key of a table: its default, ``...`` where it is required, and its meaning."""
    return Field(default=default, description=meaning)


class Table(BaseModel):
    """A TOML table: no unknown keys, no text for numbers, no nan or inf."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        frozen=True,
        validate_default=True,
        defer_build=True,  # tables are only read as part of the whole file
    )


_UNITS = {
    "mm_min": MM_PER_MIN,
    "m_s": 1.0,
    "deg_s": DEG,
    "percent": PERCENT,
    "deg": DEG,
    "mm": MM,
    "mm_per_m": MM,
    "rpm": RPM,
    "ms": MS,
    "mb": MEGABYTE,
}
"""End of a key to what one of its unit is in SI."""


class Options:
    """A table as the program has it, in SI units: a dataclass whose fields are made by ``key``."""

    __slots__ = ()

    def with_keys(self, keys: Mapping[str, Any]) -> Self:
        """Return the options with those of a call's keys that are theirs; lists are added to."""
        names = [made.name for made in fields(self) if keys.get(made.name) not in (None, "")]  # type: ignore[arg-type]
        new = {name: _called(name, getattr(self, name), keys[name]) for name in names}
        return replace(self, **new) if new else self  # type: ignore[type-var]

    def checked(self) -> Self:
        """Return the options as they count; ValueError where keys contradict each other."""
        return self


def key(
    default: Any,  # noqa: ANN401 - and its value
    meaning: str,
    unit: str = "",
    *,
    form: Any = None,  # noqa: ANN401 - and its type
    missing: float | None = None,
    called: str = "",
    **ends: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Return a field of options that is a key of their table: its name and, at the end, its unit.

    Args:
        default: in the unit of the file.
        meaning: for the reference and for new cells.
        unit: end of the key, of ``_UNITS`` where it is not SI.
        form: type of the value in the file; else that of the default.
        missing: the value of the field where the file has none.
        called: the key, where it is not made from name and unit.
        ends: ``ge``, ``gt``, ``le`` of a number.
    """
    kind = form or Annotated[float if default is None else type(default), Field(**ends)]
    if isinstance(default, StrEnum) and form is None:
        kind = Annotated[type(default), CHOICE]
    said = list(default) if isinstance(default, tuple) else default
    entry = (kind if default is not None else kind | None, Field(default=said, description=meaning))
    value = _in_si(said, unit, missing)
    made = {"default_factory": dict} if value == {} else {"default": value}
    return field(**made, metadata={"key": (called, unit, missing, entry)})


def _called(name: str, own: Any, value: Any) -> Any:  # noqa: ANN401 - of any key
    """Return the value of a key that a call gives: one of its words, or a list added to its own."""
    if isinstance(own, StrEnum):
        if value not in tuple(words := type(own)):
            raise ValueError(f"{name} {value!r}: expected one of {', '.join(words)}")
        return words(value)
    return tuple(dict.fromkeys((*own, *value))) if isinstance(own, tuple) else value


def key_said(kind: type[Options], name: str) -> tuple[str, tuple[str, ...]]:
    """Return the meaning of the key of a field, and the words that it takes, none for any text."""
    form, entry = next(made for made in fields(kind) if made.name == name).metadata["key"][-1]  # type: ignore[arg-type]
    return str(entry.description), _words_of(form)


def _words_of(form: Any) -> tuple[str, ...]:  # noqa: ANN401 - any type
    if isinstance(form, type) and issubclass(form, StrEnum):
        return tuple(word.value for word in form)
    inner = get_args(form)
    return inner if get_origin(form) is Literal else tuple(w for f in inner for w in _words_of(f))


def tables_in(annotation: object) -> list[type[BaseModel]]:
    """Return the tables that a key holds, by its type: itself, or the entries of its list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [table for inner in get_args(annotation) for table in tables_in(inner)]


def _in_si(value: Any, unit: str, missing: float | None) -> Any:  # noqa: ANN401 - of any key
    factor = _UNITS.get(unit)
    if isinstance(value, list):
        return tuple(value if factor is None else (number * factor for number in value))
    if value is None:
        return missing
    return value if factor is None else value * factor


T = TypeVar("T", bound=Options)


def _keyed(kind: type[Options]) -> dict[str, tuple[str, str, float | None, Any]]:
    """Return for each key its field, unit, value for None, and entry of the table."""
    keyed = [(made.name, *made.metadata["key"]) for made in fields(kind) if made.metadata]  # type: ignore[arg-type]
    return {
        called or f"{name}_{unit}".rstrip("_"): (name, unit, missing, entry)
        for name, called, unit, missing, entry in keyed
    }


def _table_of(kind: type[Options]) -> type[Table]:
    keys: Any = {name: entry for name, (_, _, _, entry) in _keyed(kind).items()}
    return create_model(
        kind.__name__, __base__=Table, __doc__=kind.__doc__, __module__=kind.__module__, **keys
    )


def _made(kind: type[T], table: Table) -> T:
    values, keys = dict(table), _keyed(kind).items()
    found = {name: _in_si(values[key], unit, missing) for key, (name, unit, missing, _) in keys}
    return kind(**found).checked()


if TYPE_CHECKING:
    Read = Annotated[T, "the options that a table is read as"]
else:

    class Read:
        """The table of options, and the way from it to them."""

        def __class_getitem__(cls, kind: type[Options]) -> object:
            """Return what a table has for a type in the place of options."""
            return Annotated[_table_of(kind), AfterValidator(partial(_made, kind))]


class Placement(Table):
    """Where something stands: shift and turn."""

    xyz_mm: Vector = entry([0.0, 0.0, 0.0], "origin [mm]")
    abc_deg: Angles = entry([0.0, 0.0, 0.0], "KUKA A, B, C [deg]: R = Rz(A) Ry(B) Rx(C)")


class BoxShape(Table):
    """A box, centred in its frame."""

    size_mm: Annotated[list[Size], Field(min_length=3, max_length=3)] = entry(
        ..., "edge lengths along x, y, z [mm]"
    )


class CylinderShape(Table):
    """A cylinder along z, centred in its frame."""

    radius_mm: Size = entry(..., "radius [mm]")
    length_mm: Size = entry(..., "length along z [mm]")


class Solid(Placement):
    """A solid: exactly one of file, box and cylinder."""

    name: Text | None = entry(None, "name in messages; default: made from the table")
    file: Text | None = entry(None, "mesh file (STL, OBJ, PLY), relative to the cell file")
    box: BoxShape | None = entry(None, "a box instead of a file, centred")
    cylinder: CylinderShape | None = entry(None, "a cylinder along z instead of a file, centred")
    scale: Positive = entry(1.0, "millimetres per unit of the mesh file")

    @model_validator(mode="after")
    def _one_shape(self) -> Solid:
        given = [key for key in ("file", "box", "cylinder") if getattr(self, key) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "none of them"
            raise ValueError(f"exactly one of file, box and cylinder is needed, found {found}")
        return self


class ToolSolid(Solid):
    """A solid of the tool, in the flange."""

    cutting: bool = entry(False, "true: this part may touch the workpiece during a cut")


class LinkSolid(Solid):
    """A solid of a robot link, in the frame of that link."""

    link: Annotated[int, Field(ge=0, le=6)] = entry(
        ..., "0 = base of the robot, 1..6 = link moved by that axis"
    )
