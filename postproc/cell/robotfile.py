"""The built-in robots: ``robots/*.toml``, every number with where it comes from."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell.cell import OpwGeometry, Origin, Provenance, Robot
from postproc.errors import CellError, SourceRef
from postproc.toml import TomlText, load_toml
from postproc.units import DEG, MM, NMM_PER_RAD

_FOLDER = Path(__file__).resolve().parent / "robots"
_LENGTHS = ("a1", "a2", "b", "c1", "c2", "c3", "c4")
_FIELDS = {
    "geometry": "geometry",
    "q_min": "limits",
    "q_max": "limits",
    "qd_max": "speed",
    "qdd_max": "acceleration",
    "payload": "payload",
    "repeatability": "repeatability",
    "joint_stiffness": "stiffness",
    "link_mass": "link_mass",
    "link_com": "link_com",
}
"""Field of ``Robot`` -> table of a robot file."""


def robot_names() -> tuple[str, ...]:
    """Return the names of the built-in robots, sorted."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))


def nearest_robot(name: str) -> str:
    """Return the built-in robot whose name is most like ``name``."""
    wanted = name.lower().replace("-", "_").replace(" ", "_")
    return difflib.get_close_matches(wanted, robot_names(), n=1, cutoff=0.0)[0]


def robot_title(name: str) -> str:
    """Return the maker's name of a built-in robot."""
    return str(_file(name).data["title"])


def load_robot(name: str, source: SourceRef | None = None) -> Robot:
    """Return a built-in robot, standing at the world's origin.

    ``origins`` holds one entry for each field and, where the joints differ, one for each joint
    under ``field.A1`` .. ``field.A6``. What no source gives is marked assumed.

    Args:
        name: a name from ``robot_names``.
        source: where the name was asked for, for the error.

    Raises:
        CellError: CEL010 if there is no such robot; the message names the nearest.
    """
    if name not in robot_names():
        raise CellError(
            "CEL010",
            f"no built-in robot is named {name!r}, the nearest is {nearest_robot(name)!r}",
            source,
            hint=f"built-in robots: {', '.join(robot_names())}",
        )
    return _load(name)


@cache
def _file(name: str) -> TomlText:
    return load_toml(_FOLDER / f"{name}.toml", CellError, "CEL001")


@cache
def _load(name: str) -> Robot:
    data = _file(name).data
    geometry, limits = data["geometry"], data["limits"]
    return Robot(
        name=name,
        geometry=OpwGeometry(
            **{key: geometry[f"{key}_mm"] * MM for key in _LENGTHS},
            signs=np.array(geometry["signs"], dtype=np.float64),
            offsets=np.array(geometry["offsets_deg"]) * DEG,
        ),
        q_min=np.array(limits["min_deg"]) * DEG,
        q_max=np.array(limits["max_deg"]) * DEG,
        qd_max=np.array(data["speed"]["deg_s"]) * DEG,
        qdd_max=np.array(data["acceleration"]["rad_s2"], dtype=np.float64),
        T_world_robroot=np.eye(4),
        payload=float(data["payload"]["kg"]),
        repeatability=float(data["repeatability"]["mm"]) * MM
        if "repeatability" in data
        else float("nan"),
        joint_stiffness=_optional(data, "stiffness", "Nmm_per_rad", NMM_PER_RAD),
        link_mass=_optional(data, "link_mass", "kg", 1.0),
        link_com=_optional(data, "link_com", "mm", MM),
        origins=_origins(data),
    )


def _optional(data: Mapping[str, Any], table: str, key: str, unit: float) -> FloatArray | None:
    if table not in data:
        return None
    return np.asarray(data[table][key], dtype=np.float64) * unit


def _origins(data: Mapping[str, Any]) -> dict[str, Origin]:
    """Return origins by field; a list of kinds or sources gives one entry for each joint too."""
    origins: dict[str, Origin] = {}
    for field, table in _FIELDS.items():
        if table not in data:
            continue
        kinds, sources = data[table]["kind"], data[table]["source"]
        if isinstance(kinds, str) and isinstance(sources, str):
            origins[field] = Origin(Provenance(kinds), sources)
            continue
        kinds = [kinds] * 6 if isinstance(kinds, str) else kinds
        sources = [sources] * 6 if isinstance(sources, str) else sources
        each = [Origin(Provenance(k), s) for k, s in zip(kinds, sources, strict=True)]
        weakest = max(each, key=lambda origin: list(Provenance).index(origin.provenance))
        origins[field] = Origin(weakest.provenance, "; ".join(dict.fromkeys(sources)))
        origins.update({f"{field}.A{axis}": origin for axis, origin in enumerate(each, start=1)})
    return origins
