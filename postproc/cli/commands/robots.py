"""``postproc robots``: the built-in robots and where each number is from."""

from __future__ import annotations

from typing import Any

import click

from postproc.cli import common as cli


@cli.command("""
  postproc robots
  postproc robots kuka_kr500_r2830 --json
  postproc robots "KR 210 R2700-2"
  postproc robots --reach 2800 --payload 300
""")
@click.argument("name", required=False, shell_complete=cli.complete_robots)
@cli.option("--reach MM", "Only arms that reach this far [mm].", cli.NOT_NEGATIVE)
@cli.option("--payload KG", "Only arms that carry this much [kg].", cli.NOT_NEGATIVE)
def command(
    session: cli.Session, /, name: str | None, reach: float | None, payload: float | None
) -> int:
    """List the built-in robots, or all numbers of the robot NAME and where each is from.

    NAME in any spelling: "KR 210 R2700-2", kr210r2700_2, the $TRAFONAME of a controller.

    Provenance is published (a public source that is named) or assumed (no source was found; check
    it on the real robot). Trust: A a machine file or URDF and one more source agree, B one of these
    alone or two tables agree, C one table alone. Your own cell file can override all numbers.
    """
    from postproc.jobs.robots import robots

    if name is None:
        documents = robots(reach_mm=reach, payload_kg=payload)
        session.document({"schema": "postproc.robots/1", "robots": documents})
        session.table(_HEAD, _rows(documents))
    else:
        (document,) = robots(name)
        session.document({"schema": "postproc.robots/1", **document})
        session.show(_page(document))
    return cli.answer(good=True)


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
