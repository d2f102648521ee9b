"""``postproc robots``: the built-in robots and where each number is from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from postproc.cli import completion
from postproc.cli.common import (
    NOT_NEGATIVE,
    Session,
    answer,
    standard_options,
)

if TYPE_CHECKING:
    from postproc.cell import OpwGeometry, Origin, Robot

EPILOG = """\b
Examples:
  postproc robots
  postproc robots kuka_kr500_r2830 --json
  postproc robots "KR 210 R2700-2"
  postproc robots --reach 2800 --payload 300
"""
_LENGTHS = ("a1", "a2", "b", "c1", "c2", "c3", "c4")


@click.command(epilog=EPILOG)
@click.argument("name", required=False, shell_complete=completion.robots)
@click.option(
    "--reach", type=NOT_NEGATIVE, metavar="MM", help="Only arms that reach this far [mm]."
)
@click.option(
    "--payload", type=NOT_NEGATIVE, metavar="KG", help="Only arms that carry this much [kg]."
)
@standard_options
def command(
    session: Session, /, name: str | None, reach: float | None, payload: float | None
) -> int:
    """List the built-in robots, or all numbers of the robot NAME and where each is from.

    NAME in any spelling: "KR 210 R2700-2", kr210r2700_2, the $TRAFONAME of a controller.

    Provenance is published (a public source that is named) or assumed (no source was found; check
    it on the real robot). Trust: A a machine file or URDF and one more source agree, B one of these
    alone or two tables agree, C one table alone. Your own cell file can override all numbers.
    """
    from postproc.cell import load_robot, robot_names

    if name is None:
        documents = [robot_document(load_robot(known)) for known in robot_names()]
        documents = [d for d in documents if _serves(d, reach, payload)]
        session.document({"schema": "postproc.robots/1", "robots": documents})
        session.table(_HEAD, _rows(documents))
    else:
        document = robot_document(load_robot(name))
        session.document({"schema": "postproc.robots/1", **document})
        session.show(_page(document))
    return answer(good=True)


def _serves(document: dict[str, Any], reach: float | None, payload: float | None) -> bool:
    """Return whether an arm reaches [mm] and carries [kg] as much as is asked."""
    return bool(document["reach_mm"] >= (reach or 0) and document["payload_kg"] >= (payload or 0))


def robot_document(robot: Robot) -> dict[str, Any]:
    """Return a built-in robot in the units of files, with the source of each number."""
    import numpy as np

    from postproc.cell import OpwGeometry, robot_notes, robot_title
    from postproc.units import DEG, MM, NMM_PER_RAD

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
        "dimensions_mm": {key: _plain(getattr(geometry, key) / MM) for key in _LENGTHS},
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
    import math

    return geometry.a1 + geometry.c2 + math.hypot(geometry.c3, geometry.a2)


def _sources(robot: Robot) -> dict[str, Any]:
    """Return provenance and source by key; a list of six where a key has a number per joint."""
    import numpy as np

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
        "dimensions_mm": dict.fromkeys(_LENGTHS, geometry),
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
    import numpy as np

    array = np.asarray(value, dtype=float)
    if array.ndim:
        return [_plain(entry) for entry in array]
    return round(float(array), 9) + 0.0 if np.isfinite(array) else None


def _known(values: Any) -> Any:  # noqa: ANN401 - as _plain
    """Return numbers for JSON, null where no source gives them."""
    import numpy as np

    return None if np.isnan(values).any() else _plain(values)


def _scaled(value: Any, unit: float) -> Any:  # noqa: ANN401 - as _plain
    return None if value is None else _plain(value / unit)


_HEAD = ("name", "robot", "reach mm", "payload kg", "trust", "unknown or assumed")


def _rows(documents: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for d in documents:
        payload = "?" if d["payload_kg"] is None else f"{d['payload_kg']:g}"
        row = (d["name"], d["title"], f"{d['reach_mm']:.1f}", payload, d["trust"], _assumed(d))
        rows.append(row)
    return rows


def _assumed(document: dict[str, Any]) -> str:
    """Return which numbers no source gives, such as ``speed A4-A6``."""
    needed = {"limits": "limits_deg", "speed": "speed_deg_s"}
    found = [f"no {word}" for word, key in needed.items() if document[key] is None]
    for key, source in document["sources"].items():
        word = key.rsplit("_", 1)[0].replace("_deg", "").replace("_", " ")
        origins = source if isinstance(source, list) else [source]
        if "provenance" not in origins[0]:
            origins = list(origins[0].values())
        axes = [i for i, origin in enumerate(origins, 1) if origin["provenance"] == "assumed"]
        if axes:
            some = len(axes) < len(origins)
            found.append(f"{word} A{axes[0]}-A{axes[-1]}" if some else word)
    return ", ".join(found)


def _page(d: dict[str, Any]) -> str:
    """Return all numbers of a robot; the number behind a line names its source below."""
    notes: dict[tuple[str, str], int] = {}
    lines = [f"{d['name']}: {d['title']}, reach {d['reach_mm']:.1f} mm, trust {d['trust']}"]
    lines += [f"in doubt: {text}" for text in d["doubts"]]
    lines += [f"note: {d['note']}"] if d["note"] else []
    lines += [f"$TRAFONAME: {d['trafoname']}"] if d["trafoname"] else []
    lines += [f"not known: {_assumed(d)}"] if "no " in _assumed(d) else []
    lines.append("")
    for key, value in d.items():
        source = d["sources"].get(key)
        if source is None or value is None:
            continue
        marks = _marks(source, notes)
        if isinstance(value, dict):
            text = "  ".join(f"{name} {number:g}" for name, number in value.items())
            lines.append(f"{key}: {text}  {marks[0]}")
        elif isinstance(value, list) and isinstance(value[0], list):
            lines.append(f"{key}:")
            marks = marks if len(marks) == len(value) else marks * len(value)
            for axis, (row, mark) in enumerate(zip(value, marks, strict=True), start=1):
                lines.append(f"  A{axis}: {', '.join(f'{v:g}' for v in row)}  {mark}")
        else:
            numbers = [f"{v:g}" for v in (value if isinstance(value, list) else [value])]
            each = len(marks) == len(numbers) and len(set(marks)) > 1
            text = " ".join(map("".join, zip(numbers, marks, strict=True))) if each else ""
            lines.append(f"{key}: {text or ' '.join(numbers) + '  ' + marks[0]}")
    lines.append("")
    lines += [f"[{mark}] {kind}: {source}" for (kind, source), mark in notes.items()]
    return "\n".join(lines)


def _marks(source: Any, notes: dict[tuple[str, str], int]) -> list[str]:  # noqa: ANN401 - one or six
    origins = source if isinstance(source, list) else [source]
    origins = list(origins[0].values()) if "provenance" not in origins[0] else origins
    keys = [(origin["provenance"], origin["source"]) for origin in origins]
    return [f"[{notes.setdefault(key, len(notes) + 1)}]" for key in keys]
