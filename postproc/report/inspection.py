"""What was read from a CAM file, as the document of ``inspect --json`` and as text for people."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import Finding
from postproc.model import CamSetup, CamTool, EventKind, MotionKind, ToolPath, WordUse
from postproc.toml import toml_value
from postproc.units import MM, MM_PER_MIN

SCHEMA = "postproc.inspect/1"
_FRAME = "# frame = { xyz_mm = [..., ..., ...], abc_deg = [..., ..., ...] }"
MOST_TOOLS = 16
"""KUKA TOOL numbers of a delivered controller."""
_AXIS_STEP = 1e-6
_LENGTH_DIGITS = 6
_FEED_DIGITS = 6


def inspection(toolpath: ToolPath) -> dict[str, Any]:
    """Return the document of ``inspect --json``.

    Lengths count from the first point on and from where the tool really stands: after a hole that
    is at its retract height. The way from hole to hole, down to where the feed starts, is rapid;
    drill strokes count nowhere, nor do joint motions, whose path only a robot knows. Arcs and
    helices count along the arc. Axes are distinct if they differ by more than 1e-6 in a component.
    """
    kind = toolpath.kind
    cutting, rapid = lengths(toolpath)
    return {
        "schema": SCHEMA,
        "format": toolpath.format,
        "dialect": toolpath.dialect,
        "units": toolpath.units,
        "assumed": list(toolpath.assumed),
        "points": len(toolpath),
        "rapid_points": int((kind == MotionKind.RAPID).sum()),
        "arcs": len(toolpath.arcs),
        "holes": int((kind == MotionKind.HOLE).sum()),
        "tools": len(toolpath.tools),
        "cell_tables": cell_tables(toolpath),
        "setups": [
            {"name": setup.name, "line": setup.line, "placed": setup.matrix is not None}
            for setup in toolpath.setups
        ],
        "tool_changes": sum(event.kind is EventKind.TOOL_CHANGE for event in toolpath.events),
        "tool_axes": distinct_axes(toolpath.axes),
        "box_mm": _box_mm(toolpath.points),
        "start_mm": None if toolpath.start is None else _mm(toolpath.start),
        "cycles": cycle_levels(toolpath),
        "cutting_length_mm": round(cutting / MM, _LENGTH_DIGITS),
        "rapid_length_mm": round(rapid / MM, _LENGTH_DIGITS),
        "feeds_mm_min": _feeds_mm_min(toolpath.feed),
        "operations": [operation.name for operation in toolpath.operations],
        "words": dict(toolpath.words),
        "unknown_words": dict(toolpath.unknown_words),
        "word_uses": [_word_use(use) for use in toolpath.word_uses],
        "warnings": [_warning(finding) for finding in toolpath.warnings],
        "recovered": [_warning(finding) for finding in toolpath.recovered],
    }


def cycle_levels(toolpath: ToolPath) -> list[dict[str, Any]]:
    """Return each drill cycle with the levels of its first hole, along the tool axis there."""
    holes = np.flatnonzero(toolpath.kind == MotionKind.HOLE)
    numbers, first, count = np.unique(toolpath.cycle[holes], return_index=True, return_counts=True)
    found = []
    for number, row, times in zip(numbers.tolist(), holes[first].tolist(), count, strict=True):
        if number < 0 or np.isnan(toolpath.axes[row]).any():
            continue  # without a tool axis there are no levels along it
        cycle = toolpath.cycles[number]
        top = float(toolpath.points[row] @ toolpath.axes[row])
        levels = {
            "approach_mm": top + cycle.clearance, "surface_mm": top, "depth_mm": top - cycle.depth,
            "retract_mm": top + cycle.retract,
        }  # fmt: skip
        found.append(
            {
                "cycle": str(cycle.kind),
                "line": int(toolpath.line[row]),
                "holes": int(times),
                **{name: _mm(value) for name, value in levels.items()},
            }
        )
    return sorted(found, key=lambda item: item["line"])


def _mm(value: Any) -> Any:  # noqa: ANN401 - a number or a point
    """Return a number or a point [m] in mm, rounded as all lengths are."""
    return (np.round(np.asarray(value) / MM, _LENGTH_DIGITS) + 0.0).tolist()


def lengths(toolpath: ToolPath) -> tuple[float, float]:
    """Return the cutting and the rapid length [m], see ``inspection``."""
    kind, points = toolpath.kind, toolpath.points
    if len(points) < 2:
        return 0.0, 0.0
    leave, enter = np.array(points), np.array(points)
    holes = np.flatnonzero(kind == MotionKind.HOLE)
    if len(holes):
        index = toolpath.cycle[holes]
        retract = np.array([cycle.retract for cycle in toolpath.cycles])[index]
        clearance = np.array([cycle.clearance for cycle in toolpath.cycles])[index]
        leave[holes] += retract[:, None] * np.nan_to_num(toolpath.axes[holes])
        enter[holes] += clearance[:, None] * np.nan_to_num(toolpath.axes[holes])
    way = np.zeros(len(points))
    way[1:] = np.linalg.norm(enter[1:] - leave[:-1], axis=1)
    arcs = np.flatnonzero(kind == MotionKind.ARC)
    way[arcs] = _arc_lengths(toolpath, leave, arcs)
    way = np.where(np.isnan(way), 0.0, way)
    is_cut = (kind == MotionKind.LINEAR) | (kind == MotionKind.ARC)
    is_rapid = (kind == MotionKind.RAPID) | (kind == MotionKind.HOLE)
    return float(way[is_cut].sum()), float(way[is_rapid].sum())


def _arc_lengths(toolpath: ToolPath, leave: FloatArray, tags: np.ndarray) -> FloatArray:
    """Return the length (m,) [m] along the arcs that end at these tags; a helix rises evenly."""
    arcs, index = toolpath.arcs, toolpath.arc[tags]
    starts = leave[np.maximum(tags - 1, 0)]
    chord = toolpath.points[tags] - starts
    rise = np.einsum("ni,ni->n", chord, arcs.normal[index])
    length: FloatArray = np.hypot(arcs.radius[index] * arcs.sweep[index], rise)
    return np.where(tags > 0, length, 0.0)


def distinct_axes(axes: FloatArray) -> int:
    """Return how many unit vectors (n, 3) differ by more than 1e-6."""
    known = axes[~np.isnan(axes).any(axis=1)]
    steps = np.round(known / _AXIS_STEP).astype(np.int64) + (1 << 20)
    return len(np.unique((steps[:, 0] << 42) | (steps[:, 1] << 21) | steps[:, 2]))


def text_lines(toolpath: ToolPath) -> list[str]:
    """Return the same for people, one line a fact."""
    facts = inspection(toolpath)
    box = facts["box_mm"]
    size = " x ".join(f"{b - a:.3f}" for a, b in zip(*box, strict=True)) if box else "-"
    feeds = ", ".join(f"{feed:g}" for feed in facts["feeds_mm_min"][:12]) or "none"
    unknown = ", ".join(f"{word} ({n})" for word, n in facts["unknown_words"].items()) or "none"
    tools = "; ".join(_tool_text(toolpath, i) for i in range(len(toolpath.tools))) or "none"
    rows = [
        *([("assumed", "; ".join(toolpath.assumed))] if toolpath.assumed else []),
        ("file", toolpath.path),
        ("format", f"{facts['format']}, dialect {facts['dialect']}, in {facts['units']}"),
        ("points", f"{facts['points']}, of them {facts['rapid_points']} rapid"),
        ("arcs", str(facts["arcs"])),
        ("holes", str(facts["holes"])),
        ("tools", f"{facts['tools']}: {tools}"),
        ("tool axes", str(facts["tool_axes"])),
        ("box", f"{size} mm" + (f", from {_corner(box[0])} to {_corner(box[1])}" if box else "")),
        (
            "length",
            f"{facts['cutting_length_mm']:.1f} mm cutting, {facts['rapid_length_mm']:.1f} mm rapid",
        ),
        ("feeds", f"{feeds} mm/min" if facts["feeds_mm_min"] else feeds),
        ("unknown words", unknown),
    ]
    if toolpath.start is not None:
        rows.insert(-3, ("start", f"{_corner(facts['start_mm'])} mm, not driven"))
    rows += [
        (
            f"{item['cycle']} cycle",
            f"{item['holes']} holes; the first, line {item['line']}: feed from "
            f"{item['approach_mm'] - item['surface_mm']:.6g} mm above its surface to "
            f"{item['surface_mm'] - item['depth_mm']:.6g} mm below, retract to "
            f"{item['retract_mm'] - item['surface_mm']:.6g} mm above",
        )
        for item in facts["cycles"]
    ]
    return [f"{name:<14} {value}" for name, value in rows]


def _tool_text(toolpath: ToolPath, index: int) -> str:
    tool = toolpath.tools[index]
    size = "" if np.isnan(tool.diameter) else f" D{tool.diameter / MM:g}"
    return f"{tool.number or '-'}{size} {tool.name}".strip()


def _corner(point: list[float]) -> str:
    return "(" + ", ".join(f"{value:.3f}" for value in point) + ")"


def _box_mm(points: FloatArray) -> list[list[float]] | None:
    known = points[~np.isnan(points).any(axis=1)]
    if len(known) == 0:
        return None
    corners = np.array([known.min(axis=0), known.max(axis=0)]) / MM
    return [[float(v) for v in np.round(corner, _LENGTH_DIGITS) + 0.0] for corner in corners]


def _feeds_mm_min(feed: FloatArray) -> list[float]:
    known = feed[~np.isnan(feed)]
    return [float(v) for v in np.unique(np.round(known / MM_PER_MIN, _FEED_DIGITS))]


def _word_use(use: WordUse) -> dict[str, Any]:
    return {
        "word": use.word,
        "class": str(use.word_class),
        "refused": use.refused,
        "lines": list(use.lines),
        "reason": use.reason,
    }


def _warning(finding: Finding) -> dict[str, Any]:
    line = finding.source.line if finding.source else 1
    return {"line": line, "text": finding.message, "code": finding.code, "count": finding.count}


def cell_tables(toolpath: ToolPath) -> str:
    """Return the tools and setups of a file as tables to be pasted into a cell and filled in.

    Only where the file has several of them, or names what a cell has to place.
    """
    own = [tool.number for tool in toolpath.tools]
    may = len(set(own)) == len(own) and all(0 < number <= MOST_TOOLS for number in own)
    numbers = own if may else list(range(1, len(own) + 1))
    pairs = zip(numbers, toolpath.tools, strict=True)
    parts = [_tool_table(number, tool) for number, tool in pairs] if len(own) > 1 else []
    used = np.unique(toolpath.setup_of_tags)
    setups = [toolpath.setups[i] for i in used[used >= 0].tolist()]
    if len(setups) > 1 or any(setup.matrix is None for setup in setups):
        parts += [_base_table(i, setup) for i, setup in enumerate(setups, start=1)]
    return "\n".join(parts)


def _tool_table(number: int, tool: CamTool) -> str:
    names = [str(tool.number)] if tool.number > 0 else []
    names += [tool.name] if tool.name else []
    diameter = "..." if np.isnan(tool.diameter) else f"{tool.diameter / MM:g}"
    length = "..." if np.isnan(tool.length) else f"{tool.length / MM:g}"
    return "\n".join(
        [
            "[[tools]]",
            f"number = {number}",
            f"name = {toml_value(tool.name or f'tool {tool.number}')}",
            f"cam = {toml_value(names)}",
            f"{_FRAME}  # TCP in the flange",
            '# axis = "+z"  # axis of the TCP frame that points out of the tool',
            "# mass_kg = ...",
            "# cog_mm = [..., ..., ...]",
            f"# cutter = {{ diameter_mm = {diameter}, length_mm = {length} }}",
            "",
        ]
    )


def _base_table(number: int, setup: CamSetup) -> str:
    placed = "" if setup.matrix is None else "  # the file places it: this entry may be left out"
    return "\n".join(
        [
            f"[[bases]]{placed}",
            f"number = {number}",
            f"cam = {toml_value([setup.name])}",
            f"{_FRAME}  # in the robot root",
            "",
        ]
    )
