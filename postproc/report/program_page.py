"""The page of a converted program: robot, part and path in 3D, tags, charts, both texts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.errors import Severity
from postproc.files import read_bytes
from postproc.frames import apply
from postproc.report.page import Page, escape, packed, table
from postproc.units import DEG, MM, MM_PER_MIN, N_PER_MM

if TYPE_CHECKING:
    from postproc.errors import Issue
    from postproc.kinematics.model import Kinematics
    from postproc.model.arrays import FloatArray
    from postproc.model.cell import Cell
    from postproc.model.plan import Plan

MAX_FACES = 20_000
"""Faces of all solids together on a page; finer meshes are thinned."""


@dataclass(frozen=True, slots=True)
class TextLine:
    """Where a move stands in the program text."""

    file: str
    line: int
    text: str


def program_page(
    plan: Plan,
    cell: Cell,
    issues: Sequence[Issue] = (),
    krl_lines: Sequence[TextLine] = (),
) -> bytes:
    """Return the page of a plan as one self-contained HTML file.

    Args:
        plan: the plan; one that failed shows its failing tags and the solids that hit.
        cell: the cell it was planned for.
        issues: all findings of the conversion.
        krl_lines: per move the line of the program text, empty when no text was written.
    """
    from postproc.kinematics.model import build

    kinematics = build(cell.robot)
    failing = {i.tag_index: i.message for i in issues if i.severity is Severity.ERROR}
    page = Page(f"{plan.name}: {cell.name}", _lead(plan, failing))
    page.data = {
        **_robot(cell, kinematics),
        **_moves(plan, cell),
        **_tags(plan, cell, failing, krl_lines),
        "bodies": _bodies(cell, kinematics),
        "colliding": _colliding(issues),
    }
    page.section("Robot and path", _scene_html(plan))
    page.section("Tags", _TAGS_HTML, "wide")
    page.section("Where this tag comes from", _SOURCE_HTML, "third")
    page.section("Joint angles", _ANGLES_HTML, "half")
    page.section("Joint speeds", '<div id="speeds"></div>', "half")
    page.section("Time per operation", _operations(plan), "half")
    page.section("Findings", _findings(issues), "half")
    for asset in ("charts.js", "three.bundle.js", "program.js"):
        page.script(asset)
    return page.render()


def _lead(plan: Plan, failing: dict[int | None, str]) -> list[str]:
    tags, total = len(plan.toolpath), float(np.nansum(plan.duration))
    if failing:
        return [f"No complete program: {len(failing)} of {tags} tags fail."]
    lines = [f"{tags} tags, {len(plan)} controller points, about {total:.0f} s."]
    good = plan.stiffness[np.isfinite(plan.stiffness)]
    if len(good):
        mean, low = good.mean() / N_PER_MM, good.min() / N_PER_MM
        start = plan.stiffness_initial[np.isfinite(plan.stiffness_initial)]
        gain = (
            f", {mean / (start.mean() / N_PER_MM) - 1:+.0%} against unturned" if len(start) else ""
        )
        lines.append(f"Stiffness mean {mean:.0f} N/mm{gain}, lowest {low:.0f} N/mm.")
    if plan.compensation_note:
        lines.append(plan.compensation_note)
    return lines


def _robot(cell: Cell, kinematics: Kinematics) -> dict[str, Any]:
    zero = np.zeros(6)
    frames = kinematics.link_frames(zero)
    axes = kinematics.jacobian(zero)[3:, :].T
    robot = cell.robot
    return {
        "link_frames": [[float(v) for v in frame.ravel()] for frame in frames],
        "joint_axes": [[float(v) for v in axis] for axis in axes],
        "joint_points": [[float(v) for v in frame[:3, 3]] for frame in frames[1:]],
        "T_world_robroot": [float(v) for v in robot.T_world_robroot.ravel()],
        "limits": [
            [float(low / DEG), float(high / DEG)]
            for low, high in zip(robot.q_min, robot.q_max, strict=True)
        ],
        "speeds": [float(v / DEG) for v in robot.qd_max],
    }


def _moves(plan: Plan, cell: Cell) -> dict[str, Any]:
    rapid = ~np.isfinite(plan.speed) | np.isin(plan.role, (0, 1))
    return {
        "q": packed(plan.q),
        "time": packed(np.cumsum(np.nan_to_num(plan.duration))),
        "positions": packed(apply(_T_world_base(cell), plan.T_base_tcp[:, :3, 3])),
        "tag": packed(plan.tag, "int32"),
        "rapid": packed(rapid, "uint8"),
    }


def _T_world_base(cell: Cell) -> FloatArray:
    T: FloatArray = cell.robot.T_world_robroot @ cell.workpiece.T_robroot_base
    return T


def _tags(
    plan: Plan, cell: Cell, failing: dict[int | None, str], krl_lines: Sequence[TextLine]
) -> dict[str, Any]:
    path = plan.toolpath
    T_world_base = _T_world_base(cell)
    points = apply(T_world_base, path.points)
    cam = read_bytes(path.path).decode("latin-1").splitlines()
    first, lines = _first_moves(plan), _lines_by_tag(plan, krl_lines)
    tags = []
    for i in range(len(path)):
        values = _tag_values(plan, i, first[i])
        reason = failing.get(i)
        row = [path.tag_name(i), int(path.line[i]), *(_rounded(v) for v in values.values())]
        tags.append(
            {
                "name": path.tag_name(i),
                "row": [*row, reason or ""],
                "values": {k: v for k, v in values.items() if k != "feed"},
                "failed": reason,
                "spin": values["spin"],
                "cam": _cam_text(cam, int(path.line[i])),
                "krl": lines.get(i, []),
            }
        )
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3),) * 2
    return {
        "tags": tags,
        "columns": ["tag", "line", *_tag_values(plan, 0, -1), "finding"],
        "tag_positions": packed(points),
        "tag_axes": packed(path.axes @ T_world_base[:3, :3].T),
        "centre": [float(v) for v in (low + high) / 2],
        "extent": float(np.linalg.norm(high - low)),
        "spin_map": None,
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.4g}")


def _first_moves(plan: Plan) -> FloatArray:
    first = np.full(len(plan.toolpath), -1)
    order = np.arange(len(plan))[::-1]
    served = plan.tag[order] >= 0
    first[plan.tag[order][served]] = order[served]
    return first


def _tag_values(plan: Plan, tag: int, move: int) -> dict[str, float | None]:
    def finite(value: float, unit: float) -> float | None:
        return float(value / unit) if np.isfinite(value) else None

    n = len(plan.stiffness)
    feed = float(plan.toolpath.feed[tag]) if n else float("nan")
    return {
        "spin": finite(float(plan.spin[move]), DEG) if move >= 0 else None,
        "stiffness": finite(float(plan.stiffness[tag]), N_PER_MM) if n else None,
        "clearance": finite(float(plan.clearance[tag]), MM) if n else None,
        "feed": finite(feed, MM_PER_MIN),
    }


def _lines_by_tag(plan: Plan, krl_lines: Sequence[TextLine]) -> dict[int, list[str]]:
    found: dict[int, list[str]] = {}
    for tag, line in zip(plan.tag, krl_lines, strict=False):
        found.setdefault(int(tag), []).append(f"{line.file}:{line.line}  {line.text.strip()}")
    return found


def _cam_text(lines: list[str], line: int) -> str:
    return f"{line}  {lines[line - 1].strip()[:200]}" if 0 < line <= len(lines) else str(line)


def _bodies(cell: Cell, kinematics: Kinematics) -> list[dict[str, Any]]:
    from postproc.collision.scene import Scene

    return [
        {
            "name": body.name,
            "kind": body.kind,
            "link": body.link,
            "vertices": packed(body.vertices),
            "faces": packed(body.faces, "int32"),
        }
        for body in Scene.build(cell, kinematics).display_bodies(MAX_FACES)
    ]


def _colliding(issues: Sequence[Issue]) -> list[str]:
    names: list[str] = []
    for issue in issues:
        if issue.code == "PLN104":
            names += issue.message.split("'")[1::2]
    return sorted(set(names))


def _operations(plan: Plan) -> str:
    path = plan.toolpath
    seconds: dict[str, float] = {}
    for tag, duration in zip(plan.tag, np.nan_to_num(plan.duration), strict=True):
        index = int(path.operation[tag]) if tag >= 0 else -1
        name = path.operations[index].name if index >= 0 else "(no name)"
        seconds[name] = seconds.get(name, 0.0) + float(duration)
    rows = [[name, f"{value:.1f}"] for name, value in seconds.items()]
    return table(["operation", "seconds (estimate)"], rows) if rows else "<p>nothing to run</p>"


def _findings(issues: Sequence[Issue]) -> str:
    if not issues:
        return '<p class="good">none</p>'
    rows = "".join(
        f'<tr class="{"failing" if i.severity is Severity.ERROR else ""}">'
        f'<td class="text">{escape(i)}</td></tr>'
        for i in issues[:200]
    )
    more = f"<p>and {len(issues) - 200} more</p>" if len(issues) > 200 else ""
    return f'<div class="scroll"><table>{rows}</table></div>{more}'


def _scene_html(plan: Plan) -> str:
    choices = [("clearance", "clearance [mm]"), ("spin", "turn about the tool axis [deg]")]
    if np.isfinite(plan.stiffness).any():
        choices.insert(0, ("stiffness", "stiffness [N/mm]"))
    options = "".join(f'<option value="{k}">{escape(v)}</option>' for k, v in choices)
    return (
        '<div id="scene"></div><div class="bar"><button id="play">play</button>'
        '<input type="range" id="slider" min="0" max="1000" step="0.1" value="0">'
        '<span id="clock"></span><label>speed <select id="speed"><option>1</option>'
        "<option selected>5</option><option>20</option><option>100</option></select></label>"
        f'<label>tags by <select id="colour">{options}</select></label>'
        '<span id="low"></span><span class="legend" style="background:linear-gradient(90deg,'
        'rgb(44,76,164),rgb(38,150,140),rgb(235,200,60),rgb(200,40,40))"></span>'
        '<span id="high"></span></div>'
    )


_TAGS_HTML = (
    '<div class="bar"><label><input type="checkbox" id="failing"> failing only</label>'
    '<span id="more"></span></div><div class="scroll"><table id="tags"><thead><tr></tr></thead>'
    "<tbody></tbody></table></div>"
)
_SOURCE_HTML = (
    '<p id="which"></p><p>CAM file</p><pre id="cam"></pre><p>program</p><pre id="krl"></pre>'
    '<div id="spin"></div>'
)
_ANGLES_HTML = (
    '<div class="bar"><label>axis <select id="axis"><option value="all">all</option>'
    + "".join(f'<option value="{j}">A{j + 1}</option>' for j in range(6))
    + '</select></label></div><div id="angles"></div>'
)
