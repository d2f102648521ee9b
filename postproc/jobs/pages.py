"""Pages of jobs: what they show is computed here and drawn by ``report``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, least_by
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.emitters import ReadBack
from postproc.errors import RunKind
from postproc.jobs.check_cell import CellCheck
from postproc.jobs.convert import Conversion
from postproc.jobs.drawing import drawing_of
from postproc.jobs.place import PlaceJob
from postproc.jobs.simulated_path import setups_of
from postproc.jobs.trade import HEAD
from postproc.kinematics import build, wrist_distance
from postproc.model import ToolPath
from postproc.paths import Paths
from postproc.planning import FailingPose, colliding_pose, near_solids, plan_maps
from postproc.report.pages.cell import Stance, cell_page
from postproc.report.pages.place import place_page
from postproc.report.pages.program import lead, program_data, program_page
from postproc.report.pages.verify import MOST_ROWS, RunMaps, texts_by_motion, verify_page
from postproc.report.pages.workbench import page_json
from postproc.report.parts import ProgramText, finding_rows, tag_columns, unix_text
from postproc.units import DEG
from postproc.verification import VerifyReport

_SAMPLES = 60
"""Configurations of a joint motion among which the colliding one is looked for."""


def page_of_conversion(conversion: Conversion) -> bytes:
    """Return the page of a converted program; one that failed shows its failing tags."""
    cell, findings = conversion.cell, conversion.findings
    return program_page(
        conversion.plan,
        drawing_of(cell, every=True),
        plan_maps(conversion.plan, cell, findings),
        findings,
        program_text(conversion.files, conversion.read),
        [HEAD, *(outcome.row() for outcome in conversion.trade)] if conversion.trade else (),
        [cause.text for cause in conversion.causes],
    )


def workbench_data(conversion: Conversion) -> bytes:
    """Return what the workbench shows of a conversion, as JSON."""
    cell, findings, plan = conversion.cell, conversion.findings, conversion.plan
    maps = plan_maps(plan, cell, findings)
    text = program_text(conversion.files, conversion.read)
    columns = tag_columns(plan, cell, maps, text)
    data = program_data(plan, drawing_of(cell, every=True), maps, findings, text, columns)
    data |= {
        "findings": finding_rows(findings),
        "lead": lead(plan, maps, columns, findings),
        "causes": [cause.to_dict() for cause in conversion.causes],
    }
    return page_json(data)


def program_text(files: Mapping[str, bytes], read: ReadBack | None) -> ProgramText | None:
    """Return the line and the target of every motion, None where the emitter does not tell them."""
    if not files or read is None or read.file is None or read.line is None or read.point is None:
        return None
    texts = tuple(unix_text(files[name]) if name in files else "" for name in read.files)
    return ProgramText(read.files, texts, read.file, read.line, read.point)


def page_of_cell(checked: CellCheck) -> bytes:
    """Return the page of a cell: the robot at home, or upright (A2 -90, A3 90) without one."""
    cell = checked.cell
    kinematics = build(cell.robot)
    home, q = cell.motion.home, _stance(cell)
    colliding: list[tuple[tuple[str, ...], ...]] = []
    clearance = np.inf
    for tool in range(len(cell.tools)):
        scenes = [
            Scene.shared(cell.with_tool(tool, base), kinematics) for base in range(len(cell.bases))
        ]
        checks = [scene.check(q[None]) for scene in scenes]
        clearance = min(clearance, *(float(scene.clearance(q[None])[0]) for scene in scenes))
        found = [hits.pairs[int(hits.pair[0])] if hits.hit[0] else () for hits in checks]
        colliding.append(tuple(() if home is None else pair for pair in found))
    stance = Stance(q, kinematics.fk(q), tuple(colliding), clearance)
    return cell_page(drawing_of(cell, every=True), stance, checked.facts, checked.findings)


def page_of_verification(
    report: VerifyReport, cell: Cell, toolpath: ToolPath | None = None
) -> bytes:
    """Return the page of a verification, whose report has its run."""
    if report.run is None:
        raise ValueError("a report without its run cannot be shown")
    paths, texts = report.run.paths, texts_by_motion(report)
    margin, wrist = _margins(paths, cell)
    near = _nearest(paths, cell) if report.collisions_checked else np.nan
    maps = RunMaps(margin, wrist, texts, _poses(paths, cell, texts), near)
    return verify_page(report, drawing_of(cell, every=True), maps, toolpath)


def page_of_place(job: PlaceJob) -> bytes:
    """Return the page of a search for the best place."""
    drawing = drawing_of(job.cell, every=True)
    return place_page(drawing, _stance(job.cell), job.reach, job.ranked, job.document)


def _stance(cell: Cell) -> FloatArray:
    """Return the arm (6,) [rad] at home, or upright without one."""
    if cell.motion.home is not None:
        return np.asarray(cell.motion.home)
    upright = np.array([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]) * DEG
    inside = np.all((upright >= cell.robot.q_min) & (upright <= cell.robot.q_max))
    return upright if inside else np.zeros(6)


def _margins(paths: Paths, cell: Cell) -> tuple[FloatArray, FloatArray]:
    """Return the smallest way (m,) [rad] of each motion to a joint limit and to A5 = 0."""
    robot = cell.robot
    q = np.concatenate([paths.q, paths.q_sample])
    row = np.concatenate([np.arange(len(paths)), paths.row])
    known = np.isfinite(q).all(axis=1)
    q, row = q[known], row[known]
    limit = np.minimum(q - robot.q_min, robot.q_max - q).min(axis=1, initial=np.inf)
    wrist = np.asarray(wrist_distance(build(robot), q))
    return least_by(limit, row, len(paths)), least_by(wrist, row, len(paths))


def _nearest(paths: Paths, cell: Cell) -> float:
    """Return the smallest distance [m] of solids at the ends of motions, NaN without any near."""
    most, least = near_solids(cell), np.inf
    known = np.asarray(np.isfinite(paths.q).all(axis=1))
    for rows, here in setups_of(paths, cell, np.arange(len(paths))):
        ends = np.hstack([paths.q, paths.external])[rows[known[rows]]]
        found = Scene.shared(here, build(cell.robot)).clearance(ends, True, most)
        least = min(least, float(found.min(initial=np.inf)))
    return least if least < most else np.nan


def _poses(paths: Paths, cell: Cell, texts: Mapping[int, list[str]]) -> dict[int, FailingPose]:
    """Return a colliding configuration of each motion that collides."""
    found = {}
    for row in list(texts)[:MOST_ROWS]:
        named = [text for text in texts[row] if text.startswith(f"{RunKind.COLLISION}: ")]
        if not named:
            continue
        tool, base = int(paths.station.tool[row]), int(paths.station.base[row])
        scene = Scene.shared(cell.with_tool(tool, base), build(cell.robot))
        pose = _colliding(paths, row, scene, named[0])
        if pose is not None:
            found[row] = replace(pose, tool=tool, base=base)
    return found


def _colliding(paths: Paths, row: int, scene: Scene, text: str) -> FailingPose | None:
    q = paths.q_sample[paths.row == row]
    if not len(q):
        start = paths.q[max(row - 1, 0)]
        q = start + np.linspace(0.0, 1.0, _SAMPLES)[:, None] * (paths.q[row] - start)
    q = q[np.isfinite(q).all(axis=1)]
    if not len(q):
        return None
    return colliding_pose(q, scene, np.full(len(q), bool(paths.trace.is_cp[row])), text)
