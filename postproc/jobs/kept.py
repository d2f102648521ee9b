"""Poses of an old program that stay: offered to the planner, and told from those that changed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import binary_dilation
from scipy.spatial import cKDTree

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.comparison import about, cam_lines
from postproc.controller import load_program
from postproc.errors import DataError, SourceRef
from postproc.files import read_bytes
from postproc.geometry import rotation_angle, rotation_from_abc
from postproc.kinematics import Kinematics, build
from postproc.krl import require_sound
from postproc.model import Plan, ToolPath
from postproc.paths import run_in_cell
from postproc.planning import HELD
from postproc.records import dataclass
from postproc.units import DEG, MM

_SAME_MM, _SAME_DEG = 0.002, 0.001
"""Poses nearer than this are one, to the digits of a program."""
_AXIS = 0.1
"""A tool axis that leans by 1 rad lies as far off as this [m]: .001 deg are .002 mm."""
_LINE = 1e-12
"""A CAM line on lies as far off as this [m]: below all digits."""
_EXACT = 4
"""So often only poses that fail or cost too much are given free, then those around them as well."""
_WIDER = 4
"""Every further time so many times as many of them: the last time, all."""
_OTHER_ARM = 0.02
"""Ways between poses of another arm than the cell's differ by more than this share."""
_FEW = 3
_NOWHERE = 1e9
_SUFFIX = ".src"


@dataclass(frozen=True, slots=True)
class OldPoses:
    """The m poses of an old program: T_base_tcp (m, 4, 4) [m], joints near by (m, 6) or NaN.

    ``tool``, ``base`` (m,): their numbers; ``cam`` (m,) CAM line, 0 for none; ``ids``: CAM line to
    id of a tag, where a manifest knows it.
    """

    T: FloatArray
    q: FloatArray
    tool: IndexArray
    base: IndexArray
    cam: IndexArray
    ids: dict[str, str]


@dataclass(frozen=True, slots=True)
class Kept:
    """How many tags kept their pose, turned, moved or are new; what a free plan would gain [%]."""

    kept: int
    turned: int
    moved: int
    new: int
    gain_percent: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of the JSON document."""
        counts = {"kept": self.kept, "turned": self.turned, "moved": self.moved, "new": self.new}
        return {**counts, "gain_percent_if_free": self.gain_percent}

    def text(self) -> str:
        """Return the line for the terminal."""
        gain = "" if self.gain_percent is None else f"; a free plan gains {self.gain_percent:g} %"
        return (
            f"{self.kept} poses as before, {self.turned} turned, {self.moved} moved, "
            f"{self.new} new{gain}"
        )


def old_program(old: str, name: str) -> Path | None:
    """Return the program in ``old`` that one of this name replaces: a file, a folder, a manifest.

    None where a folder or manifest has none of the name; PIN008 if there is nothing to keep from.
    """
    path = Path(old)
    folder = path.parent if path.suffix.lower() == ".json" else path
    if folder.is_dir() and path.exists():
        programs = [p for p in sorted(folder.iterdir()) if p.suffix.lower() == _SUFFIX]
        if programs:
            return next((p for p in programs if p.stem.upper() == name.upper()), None)
    elif path.is_file():
        return path
    text = "no program to keep poses of, expected a .src file, a folder of them or a manifest"
    raise DataError("PIN008", text, SourceRef(old))


def digest_of(old: str) -> str:
    """Return a hash of all that poses could be kept of: programs, and the ids of a manifest."""
    path = Path(old)
    folder = path.parent if path.suffix.lower() == ".json" else path
    files = sorted(folder.iterdir()) if folder.is_dir() else [path]
    mark = hashlib.sha256()
    for file in files:
        if file.is_file() and file.suffix.lower() in (_SUFFIX, ".dat"):
            mark.update(file.name.encode("utf-8", "surrogateescape"))
            mark.update(read_bytes(str(file)))
            ids = about([str(file)])["ids"]
            mark.update(json.dumps(ids, sort_keys=True).encode())
    return mark.hexdigest()


def poses_of(program: Path, cell: Cell) -> OldPoses:
    """Return the poses of a program along paths, as it is run; PIN009 for that of another arm."""
    modules, kinematics = load_program(program), build(cell.robot)
    require_sound(modules)
    trace = run_in_cell(modules, program.stem, cell, kinematics)
    rows = np.flatnonzero(~trace.is_axes & np.isfinite(trace.target).all(axis=1))
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    T[:, :3, 3] = trace.target[rows, :3]
    T[:, :3, :3] = rotation_from_abc(trace.target[rows, 3:])
    last = np.maximum.accumulate(np.where(trace.is_axes, np.arange(len(trace)), -1))[rows]
    first = np.append(True, np.diff(last) != 0) & (last >= 0)
    q = np.full((len(rows), 6), np.nan)
    q[last >= 0] = trace.target[last[last >= 0]]
    _require_arm(program, cell, kinematics, q[first], T[first])
    columns = (trace.column(name).astype(np.int64) for name in ("tool_number", "base_number"))
    tool, base = (column[rows] for column in columns)
    lines = cam_lines(modules, trace)[rows]
    return OldPoses(T, q, tool, base, lines, about(trace.files, modules)["ids"])


def _require_arm(
    program: Path, cell: Cell, kinematics: Kinematics, q: FloatArray, T: FloatArray
) -> None:
    """Require that joint motions lead as far as the poses behind them lie apart."""
    tcp = (kinematics.fk(q) @ np.asarray(cell.tools[0].T_flange_tcp))[:, :3, 3]
    led, apart = (np.linalg.norm(np.diff(points, axis=0), axis=1) for points in (tcp, T[:, :3, 3]))
    far = apart > 10.0 * MM
    if far.sum() > _FEW and np.median(np.abs(led[far] / apart[far] - 1.0)) > _OTHER_ARM:
        text = f"its joint motions do not fit a {cell.robot.name}: it was made for another arm"
        raise DataError("PIN009", text, SourceRef(str(program)))


def plan_kept(
    toolpath: ToolPath, cell: Cell, old: OldPoses | None, make: Callable[[ToolPath], Plan]
) -> tuple[Plan, Kept]:
    """Return the plan that keeps the poses of an old program which it can, and how many.

    ``make`` returns the plan of a toolpath, which holds the poses of its column ``HELD``.
    """
    free = make(toolpath)
    if old is None or not len(old.T) or not len(free):
        return free, Kept(0, 0, 0, len(toolpath), None if old is None else 0.0)
    pose, is_same = _matched(free, cell, old)
    own = _tags_as_read(free, toolpath)
    held, best = np.where(_stands(free, old, cell, pose), -1, pose), free
    for number in count():
        if not (held >= 0).any():
            break
        plan = make(_holding(toolpath, old, held[own]))
        bad = _dear(plan, free, cell, held >= 0)
        if not bad.any():
            best = plan
            break
        around = _WIDER ** (1 + number - _EXACT) if number >= _EXACT else 0
        held = np.where(binary_dilation(bad, iterations=around) if around else bad, -1, held)
    return best, _counted(best, free, cell, old, pose, is_same)


def _tags_as_read(plan: Plan, toolpath: ToolPath) -> IndexArray:
    """Return which tag (n,) of the plan each of the toolpath is: an order may have been found."""
    order = np.argsort(np.asarray(plan.toolpath.line), kind="stable")
    result = np.empty(len(toolpath), dtype=np.int64)
    result[np.argsort(np.asarray(toolpath.line), kind="stable")] = order
    return result


def _holding(toolpath: ToolPath, old: OldPoses, pose: IndexArray) -> ToolPath:
    """Return the toolpath with the poses (n,) that its tags are to hold, -1 for none."""
    column = np.full((len(toolpath), 15), np.nan)
    rows = np.flatnonzero(pose >= 0)
    column[rows, :9] = old.T[pose[rows], :3, :3].reshape(-1, 9)
    column[rows, 9:] = old.q[pose[rows]]
    return replace(toolpath, extra={**toolpath.extra, HELD: column})


def _feature(
    T: FloatArray, axis: FloatArray, tool: IndexArray, base: IndexArray, cam: IndexArray
) -> FloatArray:
    """Return (m, 9) equal for poses with the same tip and axis of the same tool and base [m]."""
    lean = _AXIS * np.einsum("mij,mj->mi", T[:, :3, :3], axis)
    return np.column_stack([T[:, :3, 3], lean, tool, base, _LINE * cam])


def _matched(plan: Plan, cell: Cell, old: OldPoses) -> tuple[IndexArray, BoolArray]:
    """Return the old pose (n,) of each tag, -1 for none, and whether it is at the same place."""
    n = len(plan.toolpath)
    pose, is_same = np.full(n, -1), np.zeros(n, dtype=np.bool_)
    numbers = np.array([tool.number for tool in cell.tools])
    axes = np.array(
        [np.full(3, np.nan) if t.known_axis is None else t.known_axis for t in cell.tools]
    )
    bases = np.array([base.number for base in cell.bases])
    of_old = np.clip(np.searchsorted(np.sort(numbers), old.tool), 0, len(numbers) - 1)
    of_old = np.argsort(numbers)[of_old]
    theirs = _feature(old.T, axes[of_old], old.tool, old.base, old.cam)
    tool, base = numbers[plan.tool_of_moves], bases[plan.base_of_moves]
    cam = np.where(plan.tag >= 0, np.asarray(plan.toolpath.line)[plan.tag], 0)
    ours = _feature(np.asarray(plan.T_base_tcp), axes[plan.tool_of_moves], tool, base, cam)
    sound = np.isfinite(theirs).all(axis=1)
    rows = np.flatnonzero(plan.tag >= 0)
    if sound.any() and len(rows):
        tree = cKDTree(theirs[sound])
        ours = np.nan_to_num(ours[rows], nan=_NOWHERE)
        gap, near = tree.query(ours, distance_upper_bound=_SAME_MM * MM)
        hit = np.flatnonzero(np.isfinite(gap))
        tags = plan.tag[rows[hit]]
        pose[tags], is_same[tags] = np.flatnonzero(sound)[np.asarray(near)[hit]], True
    taken = np.isin(old.cam, old.cam[pose[pose >= 0]])
    named = {
        old.ids.get(str(line), f"line {line}"): k
        for k, line in enumerate(old.cam.tolist())
        if line and not taken[k]
    }
    for tag in np.flatnonzero(pose < 0).tolist():
        line = f"line {plan.toolpath.line[tag]}"
        pose[tag] = named.get(plan.toolpath.tag_name(tag), -1) if old.ids else named.get(line, -1)
    return pose, is_same


def _at_tags(plan: Plan, pose: IndexArray) -> IndexArray:
    """Return the move nearest to each tag that has an old pose; others lead there from afar."""
    rows = np.flatnonzero((plan.tag >= 0) & (pose[plan.tag] >= 0))
    points = np.asarray(plan.toolpath.points)[plan.tag[rows]]
    off = np.linalg.norm(plan.T_base_tcp[rows, :3, 3] - points, axis=1)
    rows = rows[np.lexsort((off, plan.tag[rows]))]
    return rows[np.flatnonzero(np.diff(plan.tag[rows], prepend=-1))]


def _is_turned(plan: Plan, old: OldPoses, pose: IndexArray, rows: IndexArray) -> BoolArray:
    """Return at which moves (m,) the tool stands turned off the old pose of its tag."""
    before = old.T[pose[plan.tag[rows]], :3, :3]
    return rotation_angle(plan.T_base_tcp[rows, :3, :3], before) >= _SAME_DEG * DEG


def _stands(plan: Plan, old: OldPoses, cell: Cell, pose: IndexArray) -> bool:
    """Return whether all tags of a plan stand as before, or are new."""
    rows = _at_tags(plan, pose)
    q = old.q[pose[plan.tag[rows]]]
    is_known = np.isfinite(q).all(axis=1)
    branch = build(cell.robot).slot(q[is_known])
    is_as_before = branch == plan.branch[rows[is_known]]
    return bool(is_as_before.all()) and not _is_turned(plan, old, pose, rows).any()


def _dear(plan: Plan, free: Plan, cell: Cell, held: BoolArray) -> BoolArray:
    """Return which tags (n,) that are held fail, or cost more than the cell lets them."""
    least = 1.0 - cell.optimize.keep_loss
    with np.errstate(invalid="ignore"):
        bad = held & (plan.stiffness < least * free.stiffness)
    known = {finding.tag_index for finding in free.errors}
    for tag in {finding.tag_index for finding in plan.errors} - known:
        if tag is not None:
            reach = 0 if held[tag] else 1  # what stands beside it leaves it no way
            bad[max(tag - reach, 0) : tag + reach + 1] = True
    if not np.isfinite(free.stiffness).any() and plan.cycle_time * least > free.cycle_time:
        bad |= held
    if len(plan.errors) > len(free.errors) and not (bad & held).any():
        bad |= held
    return bad & held


def _counted(
    plan: Plan, free: Plan, cell: Cell, old: OldPoses, pose: IndexArray, is_same: BoolArray
) -> Kept:
    rows, kept = _at_tags(plan, pose), is_same.copy()
    kept[plan.tag[rows[_is_turned(plan, old, pose, rows)]]] = False
    ratio = free.cycle_time and plan.cycle_time / free.cycle_time
    if np.isfinite(free.stiffness).any():
        ratio = float(np.nanmean(free.stiffness) / np.nanmean(plan.stiffness))
    return Kept(
        int(kept.sum()),
        int((is_same & ~kept).sum()),
        int(((pose >= 0) & ~is_same).sum()),
        int((pose < 0).sum()),
        round(100.0 * (ratio - 1.0), 4) + 0.0,
    )
