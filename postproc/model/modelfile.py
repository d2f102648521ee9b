"""``model.toml``: what the simulation knows of a robot beyond the nominal rigid arm.

The file holds one table for each effect, the registration of the measured frame where one was
fitted, and notes in words. A ``ModelFile`` is the file's content as it stands: every key carries
its unit (``offset_deg``, ``stiffness_Nmm_per_rad``) and every value is in that unit. ``si`` and
``entry`` are the border: they turn a keyed value into SI and back, by the unit in the key.

NaN stands for a number that the data could not tell (a joint the loads did not turn); such a
joint is also named in the effect's own marks (``unobservable_joints``).
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray, frozen_floats
from postproc.errors import DataError, SourceRef
from postproc.geometry import kuka_from_transform, transform_from_kuka
from postproc.model.reach import Reach
from postproc.records import dataclass
from postproc.registry import part_names
from postproc.toml import TomlText, load_toml, toml_key, toml_table, toml_value
from postproc.units import DEG, MM, MS, N_PER_MM, NMM_PER_RAD

SCHEMA = "postproc.model/1"
LARGEST = 1e15
"""No parameter in any unit comes near this."""
JOINTS = range(1, 7)
UNITS = MappingProxyType(
    {
        "Nmm_per_rad": NMM_PER_RAD,
        "N_per_mm": N_PER_MM,
        "deg_per_Nm": DEG,
        "deg_per_K": DEG,
        "deg_per_s": DEG,
        "mm_per_K": MM,
        "mm_per_s": MM,
        "deg_s": DEG,
        "per_K": 1.0,
        "ms": MS,
        "Hz": 1.0,
        "mm": MM,
        "deg": DEG,
        "rad": 1.0,
        "Nm": 1.0,
        "N": 1.0,
        "kg": 1.0,
        "s": 1.0,
        "C": 1.0,
    }
)
"""Unit at the end of a key (after an underscore) to its size in SI; longest match counts."""

Table = Mapping[str, Any]
_FRAME = ("robroot_xyz_mm", "robroot_abc_deg")
_POINT = "point_in_flange_mm"
_TOOL_WEIGHT = "has_tool_weight"
_ROOMS = ("effects", "instrument")
_KEYS = ("schema", *_ROOMS, "registration", "notes", "reach", _TOOL_WEIGHT)


@dataclass(frozen=True, slots=True)
class Registration:
    """Where the measuring device stands and which point of the tool it saw.

    ``T_measured_robroot`` (4, 4) [m]: robot root in the measured frame. ``p_flange_point`` (3,)
    [m]: the reflector in the flange. ``rms`` [m] of the fit, NaN if unknown. ``loads_at_point``:
    the loads of the campaign acted at the reflector, not at the tool point of the cell. Where the
    campaign names its ``stations`` and ``reflectors``, each has its own frame and point; the first
    of them are those above.
    """

    T_measured_robroot: FloatArray
    p_flange_point: FloatArray
    rms: float = float("nan")
    loads_at_point: bool = False
    stations: Mapping[str, FloatArray] = field(default_factory=dict)
    reflectors: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "T_measured_robroot", (4, 4))
        frozen_floats(self, "p_flange_point", (3,))


@dataclass(frozen=True, slots=True)
class ModelFile:
    """A robot model: effects by name, each a table in the file's own keys and units.

    ``text`` is where it came from (None when made by a program); ``source`` points into it.
    ``has_tool_weight``: the effects are those of the arm with its tool on and no weight of the tool
    among the loads; whatever that weight does, they have it. ``reach``: how sure it is, and where.
    ``instrument``: effects of what measured, held or carried the arm in the campaign: readings are
    foretold with them, the arm is not.
    """

    effects: Mapping[str, Table] = field(default_factory=dict)
    registration: Registration | None = None
    notes: tuple[str, ...] = ()
    text: TomlText | None = field(default=None, compare=False, repr=False)
    has_tool_weight: bool = False
    reach: Reach | None = None
    instrument: Mapping[str, Table] = field(default_factory=dict)

    @property
    def path(self) -> str:
        """Path of the file, empty if it was not read from one."""
        return self.text.path if self.text else ""

    def source(self, effect: str, key: str | None = None) -> SourceRef | None:
        """Return file and line of an effect's table or of one of its keys.

        Args:
            effect: name of the effect.
            key: of its table; None: the table itself.

        Returns:
            The place, None for a model that is from no file.
        """
        if self.text is None:
            return None
        room = "instrument" if effect in self.instrument else "effects"
        return self.text.source((room, effect) if key is None else (room, effect, key))

    def table(self, effect: str) -> Table:
        """Look up the table of an effect, of the arm or of the instrument.

        Args:
            effect: name of a table that is there.

        Returns:
            Its keys and values.
        """
        return self.instrument[effect] if effect in self.instrument else self.effects[effect]

    def require_known(self, effect: str, known: Collection[str]) -> None:
        """Refuse keys of an effect's table that the effect does not know.

        Args:
            effect: name of a table that is there.
            known: the keys that the effect reads.

        Raises:
            DataError: MOD004 with the line and the nearest known key.
        """
        for key in self.table(effect):
            if key not in known:
                raise DataError(
                    "MOD004",
                    f"effects.{effect} has no key {key!r}{_nearest(key, known)}",
                    self.source(effect, key),
                    hint=f"it knows {', '.join(sorted(known))}",
                )

    def values(
        self,
        effect: str,
        key: str,
        shape: tuple[int | None, ...] = (),
        optional: bool = False,
        within: tuple[float, float] = (-math.inf, math.inf),
    ) -> FloatArray | None:
        """Return numbers of an effect in SI, by the unit in the key.

        Args:
            effect: name of a table that is there.
            key: as in the file, such as ``offset_deg``.
            shape: expected shape; None stands for any length, () for one number.
            optional: return None instead of raising where the key is missing.
            within: least and largest number in SI that an arm can have.

        Returns:
            Numbers of this shape in SI.

        Raises:
            DataError: MOD005 missing, MOD006 not numbers of this shape, not within the bounds, or
                infinite: only a stiffness may be. NaN stands for a joint that was not seen, and for
                nothing else.
        """
        table = self.table(effect)
        if key not in table:
            if optional:
                return None
            raise DataError("MOD005", f"effects.{effect} needs {key!r}", self.source(effect))
        value = _numbers(table[key])
        if value is None or not _has_shape(value, shape):
            wanted = "one number" if shape == () else f"numbers of shape {_shape_text(shape)}"
            raise DataError(
                "MOD006", f"effects.{effect}.{key}: expected {wanted}", self.source(effect, key)
            )
        is_rigid = np.isposinf(value) & ("stiffness" in key)
        is_unseen = np.isnan(value) & (len(JOINTS) in value.shape)
        low, high = (float(np.clip(end / factor(key), -LARGEST, LARGEST)) for end in within)
        if not (is_rigid | is_unseen | ((low <= value) & (value <= high))).all():
            text = f"effects.{effect}.{key}: expected numbers from {low:g} to {high:g}"
            raise DataError("MOD006", text, self.source(effect, key))
        return si(key, value)

    def choice(self, effect: str, key: str, known: Sequence[str]) -> int:
        """Return which of some words an effect has for a key, the first where it has none.

        Args:
            effect: name of a table that is there.
            key: as in the file.
            known: what it may say.

        Returns:
            Its place among them.

        Raises:
            DataError: MOD006 for another word.
        """
        word = self.table(effect).get(key, known[0])
        if word not in known:
            text = f"effects.{effect}.{key}: expected {' or '.join(map(repr, known))}"
            raise DataError("MOD006", text, self.source(effect, key))
        return known.index(word)

    @property
    def unseen(self) -> dict[str, list[int]]:
        """Keys (``effect.key``) whose number some joints (1..6) lack: the data could not tell."""
        found: dict[str, list[int]] = {}
        for effect, table in self.effects.items():
            for key, value in table.items():
                numbers = _numbers(value)
                if numbers is not None and numbers.shape[:1] == (len(JOINTS),):
                    joints = [j for j in JOINTS if np.isnan(numbers[j - 1]).any()]
                    found |= {f"{effect}.{key}": joints} if joints else {}
        return found


def si(key: str, value: ArrayLike) -> FloatArray:
    """Return a value in SI, by the unit at the end of its key (none: no unit)."""
    return np.asarray(value, dtype=np.float64) * factor(key)


def entry(key: str, value_si: ArrayLike) -> Any:  # noqa: ANN401 - a number or nested lists
    """Return an SI value in the unit of ``key``, as a number or (nested) list for the file."""
    return (np.asarray(value_si, dtype=np.float64) / factor(key)).tolist()


def factor(key: str) -> float:
    """Return the size in SI of the unit at the end of a key, 1 for a key without unit."""
    for unit in sorted(UNITS, key=len, reverse=True):
        if key.endswith(f"_{unit}"):
            return UNITS[unit]
    return 1.0


def load_model(path: str | Path) -> ModelFile:
    """Read a ``model.toml``.

    Effects of foreign names are kept (an added effect may know them); a name that is one slip
    away from a known effect is refused. Keys inside a table are checked by the effect that reads
    them, by ``ModelFile.require_known``.

    Raises:
        DataError: MOD001 not TOML, MOD002 wrong schema, MOD003 unknown key, MOD006 wrong value.
        ReadError: IO001, IO002.
    """
    text = load_toml(path, DataError, "MOD001")
    _check_keys(text, (), _KEYS)
    if text.data.get("schema") != SCHEMA:
        raise DataError(
            "MOD002",
            f"schema is {text.data.get('schema')!r}, expected {SCHEMA!r}",
            text.source(("schema",)),
        )
    has_tool_weight = text.data.get(_TOOL_WEIGHT, False)
    if not isinstance(has_tool_weight, bool):
        place = text.source((_TOOL_WEIGHT,))
        raise DataError("MOD006", f"{_TOOL_WEIGHT}: expected true or false", place)
    arm, instrument = (_effects(text, room) for room in _ROOMS)
    parts = arm, _registration(text), _notes(text), text, has_tool_weight
    return ModelFile(*parts, _reach(text), instrument)


def save_model(model: ModelFile) -> bytes:
    """Return the bytes of a ``model.toml``; the same model gives the same bytes."""
    lines = [f'schema = "{SCHEMA}"']
    if model.notes:
        lines.append(f"notes = {toml_value(list(model.notes))}")
    if model.has_tool_weight:
        lines.append(f"{_TOOL_WEIGHT} = true")
    for room, tables in zip(_ROOMS, (model.effects, model.instrument), strict=True):
        for name, table in tables.items():
            lines += ["", f"[{room}.{toml_key(name)}]", *toml_table(table)]
    if model.registration is not None:
        lines += ["", "[registration]", *toml_table(_registration_table(model.registration))]
        for name, T in model.registration.stations.items():
            head = f"[registration.stations.{toml_key(name)}]"
            lines += ["", head, *toml_table(_frame_table(T))]
        for name, p in model.registration.reflectors.items():
            head = f"[registration.reflectors.{toml_key(name)}]"
            lines += ["", head, *toml_table(_point_table(p))]
    if model.reach is not None:
        table = model.reach.table()
        spread = toml_table(table.pop("spread"))
        lines += ["", "[reach]", *toml_table(table), "", "[reach.spread]", *spread]
    return ("\n".join(lines) + "\n").encode()


def _effects(text: TomlText, room: str) -> dict[str, dict[str, Any]]:
    tables = text.data.get(room, {})
    if not isinstance(tables, dict):
        raise DataError("MOD006", f"{room} must be tables", text.source((room,)))
    known = part_names("effects", "postproc.gap.effects") if tables else ()
    for name, table in tables.items():
        place = text.source((room, name))
        if name not in known and difflib.get_close_matches(name, known, 1, 0.85):
            raise DataError("MOD003", f"unknown effect {name!r}{_nearest(name, known)}", place)
        if not isinstance(table, dict):
            raise DataError("MOD006", f"{room}.{name} must be a table", place)
    return {name: dict(table) for name, table in tables.items()}


def _reach(text: TomlText) -> Reach | None:
    if "reach" not in text.data:
        return None
    try:
        return Reach.read(text.data["reach"])
    except (KeyError, ValueError, TypeError) as wrong:
        key = str(wrong.args[0]) if isinstance(wrong, KeyError | ValueError) else ""
        raise DataError(
            "MOD006",
            f"reach.{key}: expected the numbers that diagnose writes",
            text.source(("reach", key)),
        ) from None


def _notes(text: TomlText) -> tuple[str, ...]:
    notes = text.data.get("notes", [])
    if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
        raise DataError("MOD006", "notes must be a list of texts", text.source(("notes",)))
    return tuple(notes)


def _registration(text: TomlText) -> Registration | None:
    table = text.data.get("registration")
    if table is None:
        return None
    place = text.source(("registration",))
    if not isinstance(table, dict):
        raise DataError("MOD006", "registration must be a table", place)
    _check_keys(
        text,
        ("registration",),
        (*_FRAME, _POINT, "rms_mm", "loads_at_point", "stations", "reflectors"),
    )
    whole = ("registration",)
    xyz, abc, point = (_vector(text, whole, key) for key in (*_FRAME, _POINT))
    rms = _numbers(table.get("rms_mm", math.nan))
    if rms is None or rms.shape != ():
        raise DataError("MOD006", "registration.rms_mm: expected one number", place)
    loads_at_point = table.get("loads_at_point", False)
    if not isinstance(loads_at_point, bool):
        raise DataError("MOD006", "registration.loads_at_point: expected true or false", place)
    return Registration(
        transform_from_kuka(xyz, abc),
        si("point_in_flange_mm", point),
        float(rms) * MM,
        loads_at_point,
        _named(text, "stations", lambda at: transform_from_kuka(*_vectors(text, at, _FRAME))),
        _named(text, "reflectors", lambda at: si(_POINT, _vector(text, at, _POINT))),
    )


def _named(
    text: TomlText, kind: str, read: Callable[[tuple[str, ...]], FloatArray]
) -> dict[str, FloatArray]:
    """Return the frames of stations, or the points of reflectors, by name."""
    tables = text.data["registration"].get(kind, {})
    place = text.source(("registration", kind))
    if not isinstance(tables, dict) or not all(isinstance(t, dict) for t in tables.values()):
        raise DataError("MOD006", f"registration.{kind} must be tables", place)
    keys = _FRAME if kind == "stations" else (_POINT,)
    for name in tables:
        _check_keys(text, ("registration", kind, name), keys)
    return {name: read(("registration", kind, name)) for name in tables}


def _vectors(text: TomlText, at: tuple[str, ...], keys: Sequence[str]) -> list[FloatArray]:
    return [_vector(text, at, key) for key in keys]


def _vector(text: TomlText, at: tuple[str, ...], key: str) -> FloatArray:
    table = text.data
    for part in at:
        table = table[part]
    where, place = ".".join(at), text.source((*at, key))
    if key not in table:
        raise DataError("MOD005", f"{where} needs {key!r}", place)
    value = _numbers(table[key])
    if value is None or value.shape != (3,) or not np.all(np.isfinite(value)):
        raise DataError("MOD006", f"{where}.{key}: expected three finite numbers", place)
    return value


def _registration_table(registration: Registration) -> dict[str, Any]:
    table = _frame_table(registration.T_measured_robroot)
    table |= _point_table(registration.p_flange_point)
    if math.isfinite(registration.rms):
        table["rms_mm"] = round(registration.rms / MM, 9)
    if registration.loads_at_point:
        table["loads_at_point"] = True
    return table


def _frame_table(T: FloatArray) -> dict[str, Any]:
    """Return a frame, far below any reading, so that saving again gives the same bytes."""
    xyz_mm, abc_deg = kuka_from_transform(T)
    rounded = np.round(xyz_mm, 9), np.round(abc_deg, 11)
    return {key: (v + 0.0).tolist() for key, v in zip(_FRAME, rounded, strict=True)}


def _point_table(p: FloatArray) -> dict[str, Any]:
    return {_POINT: (np.round(p / MM, 9) + 0.0).tolist()}


def _check_keys(text: TomlText, location: tuple[str, ...], known: Sequence[str]) -> None:
    table = text.data
    for part in location:
        table = table[part]
    for key in table:
        if key not in known:
            raise DataError(
                "MOD003",
                f"unknown key {key!r}{_nearest(key, known)}",
                text.source((*location, key)),
                hint=f"known are {', '.join(known)}",
            )


def _nearest(name: str, known: Collection[str]) -> str:
    close = difflib.get_close_matches(name, sorted(known), 1, 0.5)
    return f", did you mean {close[0]!r}?" if close else ""


def _numbers(value: object) -> FloatArray | None:
    if isinstance(value, (bool, str, dict)) or value is None:
        return None
    try:
        array = np.asarray(value)
    except ValueError:
        return None
    return array.astype(np.float64) if array.dtype.kind in "iuf" else None


def _has_shape(value: FloatArray, shape: tuple[int | None, ...]) -> bool:
    return len(value.shape) == len(shape) and all(
        want is None or want == have for want, have in zip(shape, value.shape, strict=True)
    )


def _shape_text(shape: tuple[int | None, ...]) -> str:
    return " x ".join("n" if size is None else str(size) for size in shape)
