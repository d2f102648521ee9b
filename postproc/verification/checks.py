"""What can be said of the joint paths alone: limits, singularities, speeds, blending, time."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, blocks
from postproc.controller import Blend, EventWord
from postproc.errors import RunKind, Severity
from postproc.kinematics import (
    STRETCHED,
    Kinematics,
    elbow_distance,
    shoulder_distance,
    wrist_distance,
)
from postproc.paths import SLOWEST, speed_shares
from postproc.units import DEG, MM, PERCENT
from postproc.verification.report import Measure, Remark, Said
from postproc.verification.run import Run

SLACK = 0.01 * DEG
"""Digits of the text may cost this much of a margin [rad]."""
OVERHEAD = 0.05
"""Wrist centre nearer to axis 1 than this [m] is worth a warning."""
SPEED_SLACK = 1e-3
_HELD = 1e-5
"""An external axis that moves by less [m or rad] stands still: digits of the text."""


def check_joints(run: Run) -> Iterator[Said]:
    """Check limits and distances to singularities at all ends and samples."""
    paths, joint = run.paths, ~run.paths.trace.is_cp
    begins = joint & np.r_[~joint[1:], False]  # a path motion there; the last sample is its end
    alone = np.flatnonzero(joint & ~begins)
    ends = np.concatenate([alone, np.flatnonzero(begins)])
    q = np.concatenate([paths.q[ends], paths.q_sample])
    motion = np.concatenate([ends, paths.row])
    known = np.isfinite(q).all(axis=1)
    on_path = slice(int(known[: len(alone)].sum()), None)
    if not known.all():
        q, motion = q[known], motion[known]
    if len(q):
        yield from _limits(run, q, motion)
    if len(q[on_path]):
        yield from _singularities(run, q[on_path], motion[on_path])


def check_externals(run: Run) -> Iterator[Said]:
    """Check external axes against their limits, and that the program says where they are."""
    paths, trace, cell = run.paths, run.paths.trace, run.cell
    known = [int(axis.name[1]) - 1 for axis in cell.external_axes]
    other = np.delete(np.nan_to_num(trace.external), known, axis=1)
    driven = np.argwhere(other != 0.0)  # a controller without the axis writes 0 itself
    if len(driven):
        motion, column = driven[0].tolist()
        name = f"E{np.delete(np.arange(1, 7), known)[column]}"
        text = f"{name} goes to {other[motion, column]:g}, and the cell has no such axis: the "
        yield Remark(RunKind.EXTERNAL, motion, f"{text}program was made for another cell")
    for column, axis in enumerate(cell.external_axes):
        unit, name = (MM, "mm") if axis.kind == "rail" else (DEG, "deg")
        written = trace.external[:, int(axis.name[1]) - 1]
        if len(trace) and np.isnan(written).all():
            yield Remark(
                RunKind.EXTERNAL, 0, f"no motion says where {axis.name} is", Severity.WARNING
            )
        values = paths.external[:, column]
        bad = np.flatnonzero((values < axis.q_min - 1e-9) | (values > axis.q_max + 1e-9))
        if len(bad):
            yield Remark(
                RunKind.JOINT_LIMIT,
                int(bad[0]),
                f"{axis.name} at {values[bad[0]] / unit:.3f} {name} is beyond its limit "
                f"[{axis.q_min / unit:g}, {axis.q_max / unit:g}], {len(bad)} motions",
            )


def check_held(run: Run) -> Iterator[Said]:
    """Check that external axes which may not move in cuts stand still in those of a CAM file."""
    paths, is_cut = run.paths, run.is_cut
    for column, axis in enumerate(run.cell.external_axes if run.has_file else ()):
        if axis.moves_in_cuts:
            continue
        step = np.diff(paths.external[:, column], prepend=paths.external[:1, column])
        bad = np.flatnonzero(is_cut & (np.abs(step) > _HELD))
        if len(bad):
            text = f"{axis.name} moves while the tool cuts, and moves_in_cuts is false: {len(bad)}"
            yield Remark(RunKind.EXTERNAL, int(bad[0]), f"{text} motions")


def _limits(run: Run, q: FloatArray, motion: AnyIntArray) -> Iterator[Said]:
    """Check axis by axis: margins of all at once are the most memory that a check takes."""
    cell, low, high = run.cell, run.kinematics.q_min, run.kinematics.q_max
    margins = (np.minimum(q[:, axis] - low[axis], high[axis] - q[:, axis]) for axis in range(6))
    tightest = [(float(of_axis.min()), int(of_axis.argmin())) for of_axis in margins]
    axis = min(range(6), key=tightest.__getitem__)
    least, row = tightest[axis]
    yield Measure("joint_margin", least / DEG, "deg", int(motion[row]), f"A{axis + 1}")
    wanted = cell.limits.joint_margin
    by_home, at_home = _ways_home(run, q, motion)
    for axis, (least, row) in enumerate(tightest):
        margin = np.minimum(q[:, axis] - low[axis], high[axis] - q[:, axis])
        bad = margin < np.where(by_home, at_home[axis], wanted) - SLACK
        if not bad.any():
            continue
        count = len(np.unique(motion[bad]))
        what = "beyond its limit" if least < 0.0 else "closer to its limit than the margin"
        text = (
            f"A{axis + 1} at {q[row, axis] / DEG:.3f} deg is {what} "
            f"[{low[axis] / DEG:g}, {high[axis] / DEG:g}] with "
            f"{cell.limits.joint_margin / DEG:g} deg, {count} motions"
        )
        yield Remark(RunKind.JOINT_LIMIT, int(motion[row]), text)


def _ways_home(run: Run, q: FloatArray, motion: AnyIntArray) -> tuple[BoolArray, FloatArray]:
    """Return configurations (k,) on ways to and from home, and its margin (6,) [rad] for them."""
    wanted, home = np.full(6, run.cell.limits.joint_margin), run.cell.motion.home
    if home is None:
        return np.zeros(len(q), dtype=np.bool_), wanted
    stands = np.ones(len(q), dtype=np.bool_)
    for axis, angle in enumerate(home):
        stands &= np.abs(q[:, axis] - angle) < SLACK
    at_home = motion[stands]
    own = np.minimum(home - run.kinematics.q_min, run.kinematics.q_max - home)
    return np.isin(motion, np.concatenate([at_home, at_home + 1])), np.clip(own, 0.0, wanted)


def _singularities(run: Run, q: FloatArray, motion: AnyIntArray) -> Iterator[Said]:
    cell, kinematics = run.cell, run.kinematics
    wrist = _by_parts(wrist_distance, kinematics, q)
    row = int(wrist.argmin())
    yield Measure("wrist_singularity", float(wrist[row] / DEG), "deg", int(motion[row]), "A5")
    bad = wrist < cell.limits.singularity - SLACK
    if bad.any():
        text = (
            f"A5 comes within {wrist[row] / DEG:.3f} deg of the straight wrist, expected at least "
            f"{cell.limits.singularity / DEG:g} deg, {len(np.unique(motion[bad]))} motions"
        )
        yield Remark(RunKind.SINGULARITY, int(motion[row]), text)
    elbow = _by_parts(elbow_distance, kinematics, q)
    row = int(elbow.argmin())
    yield Measure("stretched_arm", float(elbow[row] / DEG), "deg", int(motion[row]), "A3")
    if elbow[row] < STRETCHED:
        detail = f"the arm is within {elbow[row] / DEG:.2f} deg of being stretched"
        yield Remark(RunKind.STRETCHED, int(motion[row]), detail, Severity.WARNING)
    if kinematics.arm is not None:
        yield from _overhead(_by_parts(shoulder_distance, kinematics, q), motion)


def _by_parts(
    distance: Callable[[Kinematics, FloatArray], FloatArray], kinematics: Kinematics, q: FloatArray
) -> FloatArray:
    """Return distances (k,) of configurations (k, 6), so that memory stays bounded."""
    return np.concatenate([distance(kinematics, q[own]) for own in blocks(len(q))])


def _overhead(distance: FloatArray, motion: AnyIntArray) -> Iterator[Said]:
    row = int(distance.argmin())
    yield Measure("wrist_over_A1", float(distance[row] / MM), "mm", int(motion[row]))
    if distance[row] < OVERHEAD:
        detail = f"the wrist centre passes within {distance[row] / MM:.0f} mm of axis 1"
        yield Remark(RunKind.OVERHEAD, int(motion[row]), detail, Severity.WARNING)


# -------------------------------------------------------------------------------------- speeds


def check_speeds(run: Run) -> Iterator[Said]:
    """Check the axis speeds that the programmed path speed needs."""
    paths, trace, cell = run.paths, run.paths.trace, run.cell
    if not len(paths.row):
        return
    still = np.flatnonzero(trace.is_cp & (trace.column("speed") < SLOWEST))
    if len(still):
        speed = float(trace.column("speed")[still[0]])
        detail = f"a path speed of {speed:g} m/s: the robot would not move, {len(still)} motions"
        yield Remark(RunKind.SPEED, int(still[0]), detail)
    ratio = speed_shares(paths, cell)
    names = [*(f"A{axis}" for axis in range(1, 7)), *(axis.name for axis in cell.external_axes)]
    worst = ratio.max(axis=1)
    row = int(worst.argmax())
    axis = int(ratio[row].argmax())
    yield Measure("axis_speed", float(worst[row] / PERCENT), "%", int(paths.row[row]), names[axis])
    if ratio[:, 6:].any():  # external axes move with the tool: how each takes part is shown
        for axis, name in enumerate(names):
            row = int(ratio[:, axis].argmax())
            share = float(ratio[row, axis] / PERCENT)
            yield Measure(f"speed_{name}", share, "%", int(paths.row[row]), name)
    counts = run.is_cut[paths.row]
    yield from _too_fast(run, ratio, counts, Severity.ERROR, names)
    yield from _too_fast(run, ratio, ~counts, Severity.WARNING, names)


def _too_fast(
    run: Run, ratio: FloatArray, rows: BoolArray, severity: Severity, names: list[str]
) -> Iterator[Said]:
    worst = ratio.max(axis=1)
    bad = rows & (worst > 1.0 + SPEED_SLACK)
    if not bad.any():
        return
    row = int(np.argmax(np.where(bad, worst, 0.0)))
    axis = int(ratio[row].argmax())
    motions = len(np.unique(run.paths.row[bad]))
    speed = run.paths.trace.column("speed")[run.paths.row[row]]
    text = (
        f"{names[axis]} would need {worst[row] / PERCENT:.0f} % of its speed for {speed:g} m/s, "
        f"{motions} motions"
    )
    yield Remark(RunKind.AXIS_SPEED, int(run.paths.row[row]), text, severity)


# ------------------------------------------------------------------------------------- blending


def check_blending(run: Run) -> Iterator[Said]:
    """Warn of blends that the controller cuts short or loses; measure the rounding of corners."""
    trace = run.paths.trace
    m = len(trace)
    if m == 0:
        return
    rows = np.flatnonzero((trace.blend == Blend.DISTANCE) & trace.is_cp)
    yield from _cut_short(run, rows[rows < m - 1])
    if not trace.is_exact[-1]:
        yield Remark(RunKind.BLEND_END, m - 1, "the last motion of the program is blended")
    stopping = (EventWord.DWELL, EventWord.HALT, EventWord.WAIT_FOR)
    for event in trace.events:
        before = event.motion - 1
        if event.word in stopping and before >= 0 and not trace.is_exact[before]:
            detail = f"blending is lost: {event.name} comes after it"
            yield Remark(RunKind.BLEND_LOST, before, detail, Severity.WARNING)


def _cut_short(run: Run, rows: AnyIntArray) -> Iterator[Said]:
    """Warn of blends that are longer than half of a neighbouring path motion."""
    paths, trace = run.paths, run.paths.trace
    rows = rows[trace.is_cp[rows + 1] & np.isfinite(paths.curves.T_start[rows, 0, 3])]
    if not len(rows):
        return
    length = paths.curves.length
    short = 0.5 * np.minimum(length[rows], length[rows + 1])
    cut = trace.column("cdis")[rows] > short * (1.0 + 1e-6) + 1e-9
    if cut.any():
        text = f"$APO.CDIS is longer than half of a neighbouring segment at {int(cut.sum())} points"
        yield Remark(
            RunKind.BLEND_CUT, int(rows[int(np.flatnonzero(cut)[0])]), text, Severity.WARNING
        )
