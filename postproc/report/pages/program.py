"""The page of a converted program: robot, part and path in 3D, tags, charts, both texts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray, IntArray
from postproc.cell import Cell
from postproc.errors import Finding, headlines
from postproc.model import MoveKind, MoveRole, Plan, ToolPath
from postproc.planning import FailingPose, PlanMaps, SpinIndex, cell_at, repairs_tried, stand_ins
from postproc.report.parts import (
    Drawing,
    Page,
    ProgramText,
    T_world_base,
    TagColumn,
    axes_in_drawn_base,
    cam_lines,
    colour_html,
    escape,
    extent_of,
    in_drawn_base,
    list_html,
    packed,
    packed_text,
    scene_data,
    table,
    tag_columns,
)
from postproc.units import DEG, MM, N_PER_MM

_LEVELS = 65534


def program_page(
    plan: Plan,
    drawing: Drawing,
    maps: PlanMaps,
    findings: Sequence[Finding] = (),
    text: ProgramText | None = None,
    presets: Sequence[Sequence[str]] = (),
    causes: Sequence[str] = (),
) -> bytes:
    """Return the page of a plan, one that failed with its failing tags and the solids that hit.

    ``text``: read back, None when none was written; ``presets``: head and rows of what each would
    lose and gain; ``causes``: why tags fail and what cures it, behind the verdict.
    """
    columns = tag_columns(plan, drawing.cell, maps, text)
    verdict, *more = lead(plan, maps, columns, findings)
    good = not any(finding.is_error for finding in findings)
    page = Page(f"{plan.name}: {drawing.cell.name}", [verdict, *causes, *more], good=good)
    page.script = "program.js"
    page.data |= program_data(plan, drawing, maps, findings, text, columns)
    motion_sections(page, columns, "Tags", spins=True)
    if presets:
        page.section("Stiffness against time", table(presets[0], presets[1:]), "half")
    page.section("Time per operation", _operations(plan), "half")
    page.findings(findings)
    return page.render()


def program_data(
    plan: Plan,
    drawing: Drawing,
    maps: PlanMaps,
    findings: Sequence[Finding],
    text: ProgramText | None,
    columns: list[TagColumn],
) -> dict[str, Any]:
    """Return what the scripts of a program's page show; arguments as ``program_page``."""
    cell, failing = drawing.cell, _failing(findings)
    return {
        **scene_data(drawing),
        **_moves(plan, cell),
        **frame_data(cell, plan.tool_of_moves, plan.base_of_moves),
        **_tags(plan.toolpath, cell, maps, columns),
        **_texts(plan, text),
        "failing": {str(tag): message for tag, message in failing.items()},
        "poses": pose_data(maps.poses, cell),
        "move_of_tag": packed(maps.moves, "int32"),
        "objective": str(cell.optimize.objective),
        "spin_map": None if maps.spins is None else _spin_map_data(maps.spins),
        "no_spin_map": maps.no_spins,
    }


def _failing(findings: Sequence[Finding]) -> dict[int, str]:
    """Return what is wrong with each tag that fails."""
    return {int(i.tag_index): i.message for i in findings if i.is_error and i.tag_index is not None}


def motion_sections(page: Page, columns: list[TagColumn], rows: str, spins: bool = False) -> None:
    """Add what all pages of motions have: scene, list, texts, joint charts; ``rows``: its heading.

    ``spins`` adds the chart over the spin about the tool axis.
    """
    page.section("Robot and path", _scene_html(columns), "seven")
    page.section(rows, list_html(_FILTERS_HTML), "five")
    page.section("CAM file and program", _SOURCE_HTML, "seven" if spins else "")
    if spins:
        heading = "Stiffness over the spin about the tool axis"
        page.section(heading, '<div id="spin"></div>', "five")
    page.section("Joint angles", _ANGLES_HTML, "half")
    page.section("Joint speeds, mean of each motion", '<div id="speeds"></div>', "half")


def lead(
    plan: Plan, maps: PlanMaps, columns: Sequence[TagColumn], findings: Sequence[Finding]
) -> list[str]:
    """Return the sentences that a program's page leads with, the verdict first."""
    tags, total, failing = len(plan.toolpath), plan.cycle_time, _failing(findings)
    margin = next((c.values for c in columns if c.key == "margin"), np.zeros(0))
    nearest = nearest_words(maps.clearance, margin)
    errors = [finding for finding in findings if finding.is_error]
    rows = [f"{row['repair']} ({row['because']}) {row['times']}x" for row in repairs_tried(plan)]
    tried = [f"Tried where something was missing at first: {'; '.join(rows)}."] if rows else []
    if failing:
        first = failing[min(failing)]
        head = f"No program: {len(failing)} of {tags} tags fail.{nearest}"
        return [head, f"First: {first}", *tried]
    if errors:
        return [f"No program: {errors[0].message}.{nearest}"]
    careful = "".join(f", but {text}" for text in headlines(findings))
    size = f"{tags} tags, {len(plan)} controller points, {time_span(total)}"
    lines = [f"Good: {size}{careful}.{nearest}"]
    good = plan.stiffness[np.isfinite(plan.stiffness)]
    if len(good):
        mean, low = good.mean() / N_PER_MM, good.min() / N_PER_MM
        start = plan.stiffness_initial[np.isfinite(plan.stiffness_initial)]
        change = mean / (start.mean() / N_PER_MM) - 1 if len(start) else 0.0
        gain = f" ({change:+.0%} by rotating about the tool axis)" if len(start) else ""
        lines.append(f"Stiffness mean {mean:.0f} N/mm{gain}, lowest {low:.0f} N/mm.")
    if plan.compensation_note:
        lines.append(plan.compensation_note)
    counts = ", ".join(f"{count} {name}" for name, count in maps.grades.items())
    lines.append(f"Margin to joint limits, straight wrist and solids: {counts}.")
    return lines + tried


def nearest_words(clearance: FloatArray | float, margin_deg: FloatArray) -> str:
    """Return the smallest clearance [m] and margin in words, nothing where none is known."""
    found = [("clearance", np.ravel(clearance) / MM, "mm")]
    found += [("margin to a joint limit", margin_deg, "deg")]
    known = [(name, values[np.isfinite(values)], unit) for name, values, unit in found]
    words = [f"{name} {v.min():.1f} {unit}" for name, v, unit in known if len(v)]
    return f" Smallest {', '.join(words)}." if words else ""


def pose_data(poses: Mapping[int, FailingPose], cell: Cell) -> dict[str, Any]:
    """Return poses of failing tags or motions for the page's scripts."""
    return {
        str(row): {
            "q": pose.q.tolist(),
            "pair": list(pose.pair),
            "point": None if pose.point is None else pose.point.tolist(),
            "note": pose.note,
            "frames": [pose.tool, pose.base],
            "stand": _stand(cell, pose.external) if len(pose.external) else None,
        }
        for row, pose in poses.items()
    }


def frame_data(cell: Cell, tool: AnyIntArray, base: AnyIntArray) -> dict[str, Any]:
    """Return the tool and the base of each move (m,) for the page's scripts; none of one each."""
    if len(cell.tools) == len(cell.bases) == 1:
        return {"frames": [], "frame": packed(np.zeros(0), "uint16")}
    pairs, row = np.unique(np.stack([tool, base], axis=1), axis=0, return_inverse=True)
    return {"frames": pairs.tolist(), "frame": packed(row.ravel(), "uint16")}


def frame_words(cell: Cell, tool: AnyIntArray, base: AnyIntArray) -> list[str]:
    """Return tool and base of each row (n,) in words, empty in a cell of one each."""
    if len(cell.tools) == len(cell.bases) == 1:
        return []
    tools = [f"tool {entry.number} {entry.name}".strip() for entry in cell.tools] + ["no tool"]
    bases = [f"base {entry.number} {entry.name}".strip() for entry in cell.bases] + ["no base"]
    return [f"{tools[t]}, {bases[b]}" for t, b in zip(tool.tolist(), base.tolist(), strict=True)]


def time_span(seconds: float) -> str:
    """Return a time for people: ``90 s``, ``22 min``, ``3 h 5 min``."""
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


def _moves(plan: Plan, cell: Cell) -> dict[str, Any]:
    """Return the moves in columns; points are given in the first workpiece's frame."""
    rapid = ~np.isfinite(plan.speed) | np.isin(plan.role, (MoveRole.ENTRY, MoveRole.RAPID))
    circles = np.flatnonzero(plan.kind == MoveKind.CIRC)
    return {
        "q": packed(plan.q),
        "time": packed(np.cumsum(np.nan_to_num(plan.duration))),
        "positions": packed(in_drawn_base(cell, plan.base_of_moves, plan.T_base_tcp[:, :3, 3])),
        "tag": packed(plan.tag, "int32"),
        "rapid": packed(rapid, "uint8"),
        "circles": packed(circles, "int32"),
        "aux": packed(in_drawn_base(cell, plan.base_of_moves[circles], plan.aux[circles])),
        **_stations(plan, cell),
    }


def _stations(plan: Plan, cell: Cell) -> dict[str, Any]:
    """Return where robot and workpiece stand, move by move, when external axes move them."""
    if not cell.external_axes or not plan.external.shape[1]:
        return {"stations": [], "station": packed(np.zeros(0), "uint16")}
    values, row = np.unique(plan.external, axis=0, return_inverse=True)
    stations = [_stand(cell, value) for value in values]
    return {"stations": stations, "station": packed(row.ravel(), "uint16")}


def _stand(cell: Cell, external: FloatArray) -> list[list[float]]:
    """Return the frames of robot and workpiece in the world where external axes (k,) stand."""
    at = cell_at(cell, external)
    return [T.ravel().tolist() for T in (np.asarray(at.robot.T_world_robroot), T_world_base(at))]


def _tags(path: ToolPath, cell: Cell, maps: PlanMaps, columns: list[TagColumn]) -> dict[str, Any]:
    path = stand_ins(path)[0]
    points = in_drawn_base(cell, maps.base, path.points)
    return {
        "names": [path.tag_name(i) for i in range(len(path))],
        "lines": packed(path.line, "int32"),
        "columns": [column.to_page() for column in columns],
        "tag_positions": packed(points),
        "tag_axes": packed(axes_in_drawn_base(cell, maps.base, path.axes)),
        "tag_frames": frame_words(cell, maps.tool, maps.base),
        "operations": [operation.name for operation in path.operations],
        "operation": packed(path.operation, "int32"),
        "tools": [f"tool {entry.number} {entry.name}".strip() for entry in cell.tools],
        "tag_tool": packed(maps.tool, "int32"),
        "grade": packed(maps.grade, "uint8"),
        **extent_of(points),
    }


def _texts(plan: Plan, text: ProgramText | None) -> dict[str, Any]:
    """Return the lines of the CAM file near tags, and the program with the line of each move."""
    known = text is not None and len(text) == len(plan)
    return {
        "cam": packed_text(cam_lines(plan.toolpath)),
        "krl_files": [] if text is None else list(text.files),
        "krl": [] if text is None else [packed_text(t) for t in text.texts],
        "krl_file": packed(text.file if known and text else np.zeros(0), "int32"),
        "krl_line": packed(text.line if known and text else np.zeros(0), "int32"),
    }


def _operations(plan: Plan) -> str:
    """Return a table with a bar for each operation: working, and other motions and waits."""
    path = plan.toolpath
    if len(plan) == 0:
        return "<p>nothing to run</p>"
    index: IntArray = np.where(plan.tag >= 0, path.operation[plan.tag], -1)
    working = np.isin(plan.role, (MoveRole.CUT, MoveRole.PLUNGE))
    seconds = np.nan_to_num(plan.duration) + plan.waits
    names = {-1: "(no name)", **{i: op.name for i, op in enumerate(path.operations)}}
    rows = []
    for k in dict.fromkeys(index.tolist()):
        mine = index == k
        rows.append((names[k], float(seconds[mine & working].sum()), float(seconds[mine].sum())))
    longest = max((total for _, _, total in rows), default=0.0) or 1.0
    body = "".join(
        f"<tr><td>{escape(name)}</td><td>{work:.1f}</td><td>{total - work:.1f}</td>"
        f'<td>{total:.1f}</td><td class="text">'
        f'<i class="bar-a" style="width:{work / longest * 140:.1f}px"></i>'
        f'<i class="bar-b" style="width:{(total - work) / longest * 140:.1f}px"></i></td></tr>'
        for name, work, total in rows
    )
    total = sum(row[2] for row in rows)
    return (
        '<table class="data" id="operations"><thead><tr><th>operation</th><th>working [s]</th>'
        "<th>moving, waiting [s]</th><th>total [s]</th><th></th></tr></thead>"
        f"<tbody>{body}</tbody></table><p>{total:.1f} s in all, estimated</p>"
    )


def _scene_html(columns: list[TagColumn]) -> str:
    order = sorted(columns, key=lambda column: column.key != "stiffness")
    return (
        '<div id="scene"></div><div class="bar"><button id="play">play</button>'
        '<input type="range" id="slider" min="0" max="1000" step="any" value="0" '
        'aria-label="time"><span id="clock"></span></div>'
        '<div class="bar"><label>speed <select id="speed"><option>1</option>'
        "<option selected>5</option><option>20</option><option>100</option></select></label>"
        '<label>view <select id="view"><option>cell</option><option>part</option>'
        "<option>tag</option></select></label>"
        f"{colour_html(order)}</div>"
    )


_FILTERS_HTML = (
    '<label><input type="checkbox" id="failing"> failing only</label>'
    '<label>state <select id="state"><option value="">all</option><option value="2">critical'
    '</option><option value="1">acceptable</option><option value="0">good</option></select></label>'
)
_SOURCE_HTML = (
    '<p id="which"></p><div class="two"><div><h3>CAM file</h3><pre id="cam"></pre></div>'
    '<div><h3 id="krl_file">program</h3><pre id="krl"></pre></div></div>'
)
_ANGLES_HTML = (
    '<div class="bar"><label>axis <select id="axis"><option value="all">all</option>'
    + "".join(f'<option value="{j}">A{j + 1}</option>' for j in range(6))
    + '</select></label><span>dashed: limits of the axis</span></div><div id="angles"></div>'
)


def _spin_map_data(spin_map: SpinIndex) -> dict[str, Any]:
    """Return the map for the page's scripts, in 65534 levels: 0 is a gap."""
    values = spin_map.index / N_PER_MM
    known = np.isfinite(values)
    low, high = (values[known].min(), values[known].max()) if known.any() else (0.0, 1.0)
    scale = (high - low) or 1.0
    level = np.where(known, np.round((np.nan_to_num(values) - low) / scale * _LEVELS) + 1, 0)
    return {
        "spins": [float(v) for v in np.round(spin_map.spins / DEG, 6)],
        "low": float(low),
        "step": float(scale / _LEVELS),
        "level": packed(level, "uint16"),
        "hit": packed(spin_map.hit, "uint8"),
    }
