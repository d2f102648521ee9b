"""The built-in robots: ``robots.toml``, every number with where it comes from."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell.cell import Cell, OpwGeometry, Robot
from postproc.cell.choices import Origin, Provenance
from postproc.errors import CellError, SourceRef, listed
from postproc.records import dataclass
from postproc.units import DEG, MM, NMM_PER_RAD

_FILE = Path(__file__).resolve().parent / "robots.toml"
LENGTHS = ("a1", "a2", "b", "c1", "c2", "c3", "c4")
KUKA_SIGNS = (-1, 1, 1, -1, 1, -1)
"""q_opw = sign * q_kuka - offset, of every six-axis arm of KUKA."""
KUKA_OFFSETS_DEG = (0, -90, 0, 0, 0, 0)
_SHOWN = 5
"""Names of robots in one message at most."""
_ASSUMED_RAMP = 0.5
"""Seconds to full speed, where nothing says how fast a joint accelerates."""
_FIELDS = {
    "geometry": "lengths",
    "q_min": "limits",
    "q_max": "limits",
    "qd_max": "speed",
    "qdd_max": "acceleration",
    "payload": "payload",
    "mass": "mass",
    "repeatability": "repeatability",
    "joint_stiffness": "stiffness",
    "link_mass": "link_mass",
    "link_com": "link_com",
}
"""Field of ``Robot`` -> name of its source in the robot file."""
_SINGLE = {"M": "B", "K": "B", "X": "B"}
"""Trust of a number that rests on this source alone; C for any other."""

_SERIES_KG = {
    "agilus": (3, 10), "cybertech": (6, 22), "iontec": (20, 70), "quantec": (90, 300),
    "fortec": (240, 600), "titan": (750, 1000),
}  # fmt: skip
"""Rated payloads [kg] of KUKA's series, as its brochures give them."""
_FILLING = {"kuka", "robot", "industrial", *_SERIES_KG} - {"titan"}
"""Words that tell no arm from another; a titan has no other name."""
_NO_NAME = re.compile(
    r"c[1-5](sr|vkrc)?|flr|clg|wll|wal|deck|boden|wand|g|s|zh\d.*|\d{3}|krc\d", re.I
)
"""Words of a $TRAFONAME behind the name of the arm: controller, mounting, hand, volts."""


def robot_names() -> tuple[str, ...]:
    """Return the names of the built-in robots, sorted."""
    return tuple(_texts()[1])


def robot_title(name: str) -> str:
    """Return the maker's name of a built-in robot."""
    return str(_row(name)["title"])


@dataclass(frozen=True, slots=True)
class RobotNotes:
    """What is known of a built-in robot beside its numbers.

    ``trust`` of the lengths: A, B or C, see the robot file; ``trafoname``: $TRAFONAME of a real
    controller, empty where none was seen; ``note``: where sources differ.
    """

    trust: str
    trafoname: str
    note: str


def robot_notes(name: str) -> RobotNotes:
    """Return trust, controller name and note of a built-in robot."""
    row = _row(name)
    return RobotNotes(row["trust"], row.get("trafoname", ""), row.get("note", ""))


def find_robot(name: str, source: SourceRef | None = None) -> str:
    """Return the built-in robot that is meant: its name, title or $TRAFONAME in any spelling."""
    if name in _texts()[1]:
        return name
    found = _spellings().get(normal(name)) or _spellings().get(normal(type_of(name)))
    if found is not None:
        return found
    lists = f"`postproc robots` lists all {len(robot_names())}"
    several = candidates(type_of(name), robot_names())
    series = series_of(name)
    if series is not None:
        kg = "-".join(f"{limit}" for limit in series)
        text = f"{name!r} is a series of KUKA, about {kg} kg, expected one of its arms"
        hint = f"`postproc robots --payload {series[0]}` lists those that carry as much"
    elif several and normal(name):
        several.sort(key=lambda known: _row(known)["trust"])
        some = listed(several, _SHOWN)
        text = f"{name!r} may be any of {len(several)} robots, name one: {some}"
        hint = lists
    elif normal(name).startswith("kr"):
        near = nearest(name, robot_names())
        text = f"no built-in robot is named {name!r}, the nearest is {near[0]!r}"
        hint = f"near: {', '.join(near)}; {lists}"
    else:
        text = f"no built-in robot is named {name!r}: all {len(robot_names())} are arms of KUKA"
        hint = "another six-axis arm comes from its URDF: postproc new-cell --urdf FILE"
    raise CellError("CEL010", text, source, hint=hint)


def load_robot(name: str, source: SourceRef | None = None) -> Robot:
    """Return a built-in robot, as ``find_robot`` finds it, standing at the world's origin.

    ``origins`` holds one entry for each field and, where the joints differ, one for each joint
    under ``field.A1`` .. ``field.A6``. What no source gives is NaN, accelerations apart: they are
    assumed such that a joint reaches full speed in half a second.
    """
    return _load(find_robot(name, source))


def unknown_arm(name: str, lengths_mm: list[float]) -> Robot:
    """Return an arm of KUKA of which only the lengths are known, see ``kuka_geometry``."""
    unknown = np.full(6, np.nan)
    return Robot(
        name=name,
        geometry=kuka_geometry(lengths_mm),
        q_min=unknown,
        q_max=unknown,
        qd_max=unknown,
        qdd_max=unknown,
        T_world_robroot=np.eye(4),
    )


def require_numbers(cell: Cell) -> None:
    """Refuse an arm without known limits or speeds where motions are planned or judged."""
    problem = missing_numbers(cell)
    if problem is not None:
        raise problem


def missing_numbers(cell: Cell) -> CellError | None:
    """Return what ``require_numbers`` refuses a cell for, None if nothing is missing."""
    robot = cell.robot
    limits = robot.doubts.get("q_min", "")
    if limits or not np.isfinite(robot.q_min + robot.q_max).all():
        return _missing(cell, "limits", "limits_deg", "$SOFTN_END and $SOFTP_END", limits)
    if not np.isfinite(robot.qd_max).all():
        return _missing(cell, "speeds", "speed_deg_s", "$VEL_AXIS_MA and $RAT_MOT_AX")
    return None


def _missing(cell: Cell, what: str, key: str, variables: str, why: str = "") -> CellError:
    reason = why or f"no source gives the {what} of {cell.robot.name}"
    text = (
        f"from the data sheet, or from the controller ({variables} of $machine.dat): "
        "postproc new-cell --backup reads it"
    )
    return CellError("CEL030", f"{reason}: [robot] {key} is needed", SourceRef(cell.path), text)


def assumed_acceleration(speed: FloatArray) -> tuple[FloatArray, Origin]:
    """Return accelerations [rad/s^2] for speeds [rad/s] where no source gives any."""
    text = f"no source found; full speed in {_ASSUMED_RAMP:g} s"
    return speed / _ASSUMED_RAMP, Origin(Provenance.ASSUMED, text)


@cache
def _texts() -> tuple[str, Mapping[str, str]]:
    """Return what stands before the arms, and the table of each by its name: one is read alone."""
    sources, *arms = _FILE.read_text(encoding="utf-8").split("\n[arms.")
    return sources, {text.partition("]")[0]: f"[arms.{text}" for text in arms}


@cache
def _row(name: str) -> Mapping[str, Any]:
    row: Mapping[str, Any] = tomllib.loads(_texts()[1][name])["arms"][name]
    return row


@cache
def _sources() -> Mapping[str, Mapping[str, str]]:
    sources: Mapping[str, Mapping[str, str]] = tomllib.loads(_texts()[0])["sources"]
    return sources


@cache
def _spellings() -> Mapping[str, str]:
    """Return the name of each arm by all its spellings, without signs between letters."""
    found: dict[str, str] = {}
    for name in robot_names():
        row = _row(name)
        own = [normal(name), normal(row["title"]), normal(row["title"].split(" (")[0])]
        own += [normal(row.get("trafoname", ""))]
        for spelling in own:
            found.setdefault(spelling, name)
    found.pop("", None)
    return found


@cache
def _load(name: str) -> Robot:
    row = _row(name)
    origins = _origins(row)
    qd_max = _values(row, "speed_deg_s", DEG)
    qdd_max = _optional(row, "acceleration_rad_s2", 1.0)
    if qdd_max is None:
        qdd_max, origins["qdd_max"] = assumed_acceleration(qd_max)
    return Robot(
        name=name,
        geometry=kuka_geometry(row["lengths_mm"]),
        q_min=_values(row, "min_deg", DEG),
        q_max=_values(row, "max_deg", DEG),
        qd_max=qd_max,
        qdd_max=qdd_max,
        T_world_robroot=np.eye(4),
        payload=float(row["payload_kg"]),
        mass=float(row.get("mass_kg", np.nan)),
        repeatability=float(row.get("repeatability_mm", np.nan)) * MM,
        joint_stiffness=_optional(row, "stiffness_Nmm_per_rad", NMM_PER_RAD),
        link_mass=_optional(row, "link_mass_kg", 1.0),
        link_com=_optional(row, "link_com_mm", MM),
        origins=origins,
        doubts={
            field: row[key]
            for field, key in (("geometry", "doubt_lengths"), ("q_min", "doubt_limits"))
            if key in row
        },
    )


def kuka_geometry(lengths_mm: list[float]) -> OpwGeometry:
    """Return the geometry of an arm of KUKA from a1, a2, b, c1, c2, c3, c4 [mm]."""
    return OpwGeometry(
        **{key: float(value) * MM for key, value in zip(LENGTHS, lengths_mm, strict=True)},
        signs=np.array(KUKA_SIGNS, dtype=np.float64),
        offsets=np.array(KUKA_OFFSETS_DEG) * DEG,
    )


def _values(row: Mapping[str, Any], key: str, unit: float) -> FloatArray:
    """Return six numbers, NaN where no source gives them."""
    return np.asarray(row.get(key, [np.nan] * 6), dtype=np.float64) * unit


def _optional(row: Mapping[str, Any], key: str, unit: float) -> FloatArray | None:
    return np.asarray(row[key], dtype=np.float64) * unit if key in row else None


def _origins(row: Mapping[str, Any]) -> dict[str, Origin]:
    """Return origins by field; a list of sources gives one entry for each joint too."""
    origins: dict[str, Origin] = {}
    for field, group in _FIELDS.items():
        keys = row["from"].get(group)
        if keys is None:
            continue
        trust = row["trust"] if field == "geometry" else ""
        if isinstance(keys, str):
            origins[field] = _origin(keys, trust)
            continue
        each = [_origin(key, trust) for key in keys]
        weakest = max(each, key=lambda origin: list(Provenance).index(origin.provenance))
        texts = dict.fromkeys(origin.source for origin in each)
        origins[field] = Origin(weakest.provenance, "; ".join(texts), weakest.trust)
        origins.update({f"{field}.A{axis}": origin for axis, origin in enumerate(each, start=1)})
    return origins


def _origin(key: str, trust: str) -> Origin:
    """Return the origin behind a key of ``[sources]``, or several joined by +."""
    sources = [_sources()[part] for part in key.split("+")]
    kind = Provenance(sources[0]["kind"])
    own = "" if kind is Provenance.ASSUMED else _SINGLE.get(key, sources[0].get("trust", "C"))
    return Origin(kind, "; ".join(source["text"] for source in sources), trust or own)


def normal(name: str) -> str:
    """Return a name without case, signs, blanks and the words of series; ``210`` is ``kr210``."""
    plain = re.sub(r"[_\s]+", " ", name.lower())
    plain = re.sub(r"[^a-z0-9]", "", re.sub(rf"\b({'|'.join(sorted(_FILLING))})\b", "", plain))
    return f"kr{plain}" if plain[:1].isdigit() else plain


def series_of(name: str) -> tuple[int, int] | None:
    """Return the payloads [kg] of the series that a name gives in place of an arm."""
    words = set(re.findall("[a-z]+", name.lower()))
    found = (kg for series, kg in _SERIES_KG.items() if series in words)
    return None if re.search(r"\d", name) else next(found, None)


def type_of(trafoname: str) -> str:
    """Return the part of a $TRAFONAME that names the arm: ``#KR210R2700_2 C4 FLR``: the first."""
    words = trafoname.strip().lstrip("#").split()
    for end, word in enumerate(words):
        has_number = any(sign.isdigit() for sign in "".join(words[:end]))
        if has_number and _NO_NAME.fullmatch(word):
            return " ".join(words[:end])
    return " ".join(words)


def same_type(a: str, b: str) -> bool:
    """Return whether two $TRAFONAME name the same arm."""
    return normal(type_of(a)) == normal(type_of(b))


def nearest(name: str, names: Sequence[str]) -> list[str]:
    """Return up to five of ``names``, the most like ``name`` first."""
    by_normal = {normal(known): known for known in names}
    close = difflib.get_close_matches(normal(name), by_normal, n=5, cutoff=0.0)
    return [by_normal[key] for key in close]


def candidates(name: str, names: Sequence[str]) -> list[str]:
    """Return those of ``names`` that begin with ``name``, at the end of a number or word."""
    wanted = normal(name)
    return [known for known in names if wanted and _begins(normal(known), wanted)]


def _begins(known: str, wanted: str) -> bool:
    rest = known.removeprefix(wanted)
    if rest == known:
        return False
    return not (wanted[-1].isdigit() and rest[:1].isdigit() and len(rest) > 1)
