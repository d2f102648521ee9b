"""The built-in robots in the units of files, with the source of each number."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from postproc.cell import (
    LENGTHS,
    OpwGeometry,
    Origin,
    Robot,
    load_robot,
    robot_names,
    robot_notes,
    robot_title,
)
from postproc.units import DEG, MM, NMM_PER_RAD


def robots(
    name: str | None = None, *, reach_mm: float | None = None, payload_kg: float | None = None
) -> list[dict[str, Any]]:
    """Return the built-in robots with all their numbers and where each is from.

    Args:
        name: in any spelling; None: all.
        reach_mm: only those that reach so far.
        payload_kg: only those that carry so much.

    Returns:
        For each robot what ``robots NAME --json`` prints.

    Raises:
        CellError: CEL010 for an unknown robot.
    """
    if name is not None:
        return [robot_document(load_robot(name))]
    documents = [robot_document(load_robot(known)) for known in robot_names()]
    return [
        d
        for d in documents
        if d["reach_mm"] >= (reach_mm or 0) and (d["payload_kg"] or 0) >= (payload_kg or 0)
    ]


def robot_document(robot: Robot) -> dict[str, Any]:
    """Return a built-in robot in the units of files, with the source of each number."""
    geometry = robot.geometry
    assert isinstance(geometry, OpwGeometry)  # noqa: S101 - every built-in robot has one
    limits = np.stack([robot.q_min, robot.q_max], axis=1)
    notes = robot_notes(robot.name)
    return {
        "name": robot.name,
        "title": robot_title(robot.name),
        "trafoname": notes.trafoname or None,
        "trust": notes.trust,
        "note": notes.note or None,
        "doubts": sorted(robot.doubts.values()),
        "reach_mm": round(_reach(geometry) / MM, 1),
        "dimensions_mm": {key: _plain(getattr(geometry, key) / MM) for key in LENGTHS},
        "signs": _plain(geometry.signs),
        "offsets_deg": _plain(geometry.offsets / DEG),
        "limits_deg": _known(limits / DEG),
        "speed_deg_s": _known(robot.qd_max / DEG),
        "acceleration_deg_s2": _known(robot.qdd_max / DEG),
        "payload_kg": _plain(robot.payload),
        "mass_kg": _plain(robot.mass),
        "repeatability_mm": _plain(robot.repeatability / MM),
        "joint_stiffness_Nmm_per_rad": _scaled(robot.joint_stiffness, NMM_PER_RAD),
        "link_mass_kg": _scaled(robot.link_mass, 1.0),
        "link_cog_mm": _scaled(robot.link_com, MM),
        "sources": _sources(robot),
    }


def _reach(geometry: OpwGeometry) -> float:
    """Return the distance [m] of the wrist centre from axis 1 with the arm stretched."""
    return geometry.a1 + geometry.c2 + math.hypot(geometry.c3, geometry.a2)


def _sources(robot: Robot) -> dict[str, Any]:
    """Return provenance and source by key; a list of six where a key has a number per joint."""
    by_joint = {
        "limits_deg": "q_min",
        "speed_deg_s": "qd_max",
        "acceleration_deg_s2": "qdd_max",
        "joint_stiffness_Nmm_per_rad": "joint_stiffness",
        "link_mass_kg": "link_mass",
        "link_cog_mm": "link_com",
    }
    geometry = _origin(robot.origins["geometry"])
    sources: dict[str, Any] = {
        "dimensions_mm": dict.fromkeys(LENGTHS, geometry),
        "signs": geometry,
        "offsets_deg": geometry,
    }
    for key, field in by_joint.items():
        whole = robot.origins.get(field)
        if whole is not None and not np.isnan(getattr(robot, field)).any():
            each = [robot.origins.get(f"{field}.A{axis}", whole) for axis in range(1, 7)]
            sources[key] = [_origin(origin) for origin in each]
    for field, unit in (("payload", "kg"), ("mass", "kg"), ("repeatability", "mm")):
        if field in robot.origins:
            sources[f"{field}_{unit}"] = _origin(robot.origins[field])
    return sources


def _origin(origin: Origin) -> dict[str, str]:
    found = {"provenance": str(origin.provenance), "source": origin.source}
    return {**found, "trust": origin.trust} if origin.trust else found


def _plain(value: Any) -> Any:  # noqa: ANN401 - numbers and nested lists of them
    """Return numbers for JSON: rounded to 1e-9, null for what is not known."""
    array = np.asarray(value, dtype=float)
    if array.ndim:
        return [_plain(entry) for entry in array]
    return round(float(array), 9) + 0.0 if np.isfinite(array) else None


def _known(values: Any) -> Any:  # noqa: ANN401 - as _plain
    """Return numbers for JSON, null where no source gives them."""
    return None if np.isnan(values).any() else _plain(values)


def _scaled(value: Any, unit: float) -> Any:  # noqa: ANN401 - as _plain
    return None if value is None else _plain(value / unit)
