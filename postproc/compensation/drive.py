"""A program in time: timed as a controller drives it, with what effects along the path do to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from postproc.arrays import ROUNDING, FloatArray, IntArray, forward_filled
from postproc.cell import Cell
from postproc.emitters import EMITTERS, emitter_of, motions_of
from postproc.errors import DataError, EmitError, SourceRef
from postproc.geometry import onto_line
from postproc.kinematics import Kinematics
from postproc.model import ModelFile, Plan
from postproc.paths import Paths, bends_of, chains, durations
from postproc.records import dataclass
from postproc.timing import RAMP, chain_profile
from postproc.trace import JOINTS, LONGEST, PATH_EFFECTS, Recording, Scene, Stage
from postproc.units import MM

CYCLE = 0.004
"""Interpolator cycle [s] in which a run is sampled."""
KNOT = 0.5 * MM
"""Way [m] between two places of a run at which its speed is known."""
BEHIND, AHEAD = 0.1, LONGEST
"""The tool is at a place at most so much [s] before or after its command."""
AT_ONCE = 200_000
"""Samples of a run that effects act on together."""
OVERLAP = 5_000
"""Samples before these of which effects remember: 20 s."""
LARGEST = 0.05
"""A shift beyond this [m] is no compensation but a wrong model."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A run in time, with the tool where effects along the path leave it.

    place (n,): motion and share of it, every ``CYCLE``; commanded, real (n, 3) tool point [m],
    robroot; under: what the effects, so many times as large, make of the real one.
    """

    place: FloatArray
    commanded: FloatArray
    real: FloatArray
    under: Callable[[float], FloatArray]

    def missed(self, place: FloatArray, point: FloatArray | None = None) -> FloatArray:
        """Return the way (k, 3) [m] to the real tool's path from places (k,) of the run.

        ``place``: motion and share, rising; ``point`` (k, 3) [m] robroot; None: where the command
        is there.
        """
        at = np.interp(place, self.place, np.arange(len(self.place)))
        if point is None:
            point = np.stack([np.interp(place, self.place, c) for c in self.commanded.T], axis=1)
        middle = np.rint(at).astype(np.int64)
        best, nearest = np.full(len(place), np.inf), middle.copy()
        for step in range(-int(BEHIND / CYCLE), int(AHEAD / CYCLE) + 1):
            row = np.clip(middle + step, 0, len(self.real) - 1)
            square = np.sum((self.real[row] - point) ** 2, axis=1)
            closer = square < best
            best, nearest = np.where(closer, square, best), np.where(closer, row, nearest)
        found = self.real[nearest] - point
        for low in (nearest - 1, nearest):
            start, end = (np.clip(low + k, 0, len(self.real) - 1) for k in (0, 1))
            share, off = onto_line(point, self.real[start], self.real[end])
            span = self.real[end] - self.real[start]
            way = self.real[start] + share[:, None] * span - point
            shorter = off < np.linalg.norm(found, axis=1)
            found = np.where(shorter[:, None], way, found)
        return np.asarray(found)


def check_size(
    shift: FloatArray, file: ModelFile, parts: Callable[[], Mapping[str, FloatArray]] = dict
) -> None:
    """Refuse shifts (n, 3) [m] that no real arm can need, asked for before a model fades: CMP001.

    ``parts``: the shifts of its effects by name: the largest is named by its line.
    """
    largest = _most(shift)
    if not largest <= LARGEST:
        sizes = {name: _most(part) for name, part in parts().items()}
        name = max(sizes, key=lambda n: np.nan_to_num(sizes[n], nan=np.inf), default="")
        text = f"the model asks for shifts of up to {largest / MM:.1f} mm, too large for a real arm"
        raise DataError("CMP001", text, file.source(name or next(iter(file.effects), "")))


def _most(shift: FloatArray) -> float:
    return float(np.linalg.norm(shift, axis=1).max(initial=0.0))


def driven(
    paths: Paths, cell: Cell, kinematics: Kinematics, effects: Mapping[str, FloatArray]
) -> Drive:
    """Return a run in time under effects along the path; external axes stand in path motions."""
    _standing(paths, cell)
    place, time, way, q = _timed(paths, cell)
    even = np.arange(0.0, time[-1] + CYCLE, CYCLE)
    # a controller takes the corners out of its ramps, along the path
    count = max(1, int(0.5 * RAMP / CYCLE))
    far = np.pad(np.interp(even, time, way), (count, count), "edge")
    far = np.convolve(far, np.ones(2 * count + 1) / (2 * count + 1), "valid")
    where = np.interp(far, way, place)
    command = np.stack([np.interp(far, way, column) for column in q.T], axis=1)
    moved = _displaced(even, command, cell, kinematics, effects)
    motion = np.clip(np.ceil(where).astype(np.int64) - 1, 0, len(paths) - 1)
    tool = cell.tcp_of(paths.station.tool[motion])[:, :3, 3]

    def under(size: float) -> FloatArray:
        return _carried(kinematics, command + size * moved, tool)

    return Drive(where, under(0.0), under(1.0), under)


def _standing(paths: Paths, cell: Cell) -> None:
    """Refuse path motions in which external axes move: the tool is followed in the robot root."""
    moves = np.any(np.abs(np.diff(paths.external, axis=0)) > ROUNDING, axis=1)
    at = np.flatnonzero(moves & paths.trace.is_cp[1:])
    if len(at):
        text = (
            f"external axes move in {len(at)} path motions: effects that a trace has shown can be "
            "followed with external axes that stand only"
        )
        raise EmitError("CMP008", text, SourceRef(cell.path))


def _carried(kinematics: Kinematics, q: FloatArray, tool: FloatArray) -> FloatArray:
    T = kinematics.fk(q)
    return np.asarray(np.einsum("nij,nj->ni", T[:, :3, :3], tool) + T[:, :3, 3])


def _displaced(
    time: FloatArray,
    command: FloatArray,
    cell: Cell,
    kinematics: Kinematics,
    effects: Mapping[str, FloatArray],
) -> FloatArray:
    """Return what effects do to the joints (n, 6) [rad] of a course."""
    found = np.zeros_like(command)
    tool = np.asarray(cell.tool.T_flange_tcp[:3, 3])
    for first in range(0, len(time), AT_ONCE):
        rows = slice(max(0, first - OVERLAP), first + AT_ONCE)
        count = len(time[rows])
        one = np.ones(count, dtype=np.int32)
        scene = Scene(Recording("", time[rows], one, one, command[rows]), kinematics, tool)
        stage = Stage(JOINTS, scene, np.zeros((6, count)))
        parts = [PATH_EFFECTS.get(n).part(stage, t, False).value for n, t in effects.items()]
        total = np.sum(parts, axis=0).T if parts else np.zeros((count, 6))
        found[first : first + AT_ONCE] = total[first - rows.start :]
    return found


def _timed(paths: Paths, cell: Cell) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return place, time [s], way [m; joint motions rad] and joints (k, 6) at knots of a run."""
    row, share, q, *_ = paths.in_order()
    q = forward_filled(q)
    trace, length = paths.trace, paths.curves.length
    before = np.where(np.diff(row, prepend=-1) == 0, np.roll(share, 1), 0.0)
    turned = np.linalg.norm(np.diff(q, axis=0, prepend=q[:1]), axis=1)
    step = np.where(trace.is_cp[row], length[row] * (share - before), turned)
    parts = np.where(trace.is_cp[row], np.ceil(step / KNOT), 1).astype(np.int64).clip(1)
    number = np.repeat(np.arange(len(row)), parts)
    inner = np.arange(len(number)) - np.repeat(np.cumsum(parts) - parts, parts) + 1.0
    inner = inner / parts[number]
    place = (row + before)[number] + (inner * (share - before)[number])
    last = np.concatenate([q[:1], q[:-1]])
    fine = last[number] + inner[:, None] * (q - last)[number]
    way = step[number] / parts[number]
    motion = row[number]
    needed = durations(paths, cell)
    spent = needed[motion] * (inner * (share - before)[number])
    speed, push = trace.column("speed"), trace.column("acceleration")
    corner = np.full(len(paths), np.inf)
    cp = np.flatnonzero(trace.is_cp)
    if len(cp) > 1:
        corner[cp[:-1]] = bends_of(paths, cp).corner_speeds(length[cp], push[cp])
    chain = chains(paths)[motion]
    for first in np.flatnonzero(np.diff(chain, prepend=-1) != 0).tolist():
        own = slice(first, first + int(np.searchsorted(chain[first:], chain[first], "right")))
        if not trace.is_cp[motion[first]] or way[own].sum() <= 0.0:
            continue
        ends = np.r_[motion[own][1:] != motion[own][:-1], True]
        slow = np.where(ends, corner[motion[own]], np.inf)[:-1]
        top = np.maximum(speed[motion[own]], 1e-6)
        knots = np.r_[0.0, np.cumsum(way[own])]
        spent[own] = chain_profile(knots, top, push[motion[own]], RAMP, slow).duration
    return place, np.cumsum(spent), np.cumsum(way), fine


def run_of(plan: Plan, cell: Cell, kinematics: Kinematics) -> tuple[Paths, IntArray]:
    """Return how a plan's program is run, and the motion (m,) of each move.

    CMP007 if the emitter does not know, CMP004 if the program is another.
    """
    with EMITTERS.blame(cell.krl.emitter):
        paths = emitter_of(cell).paths(plan, cell, kinematics)
    if paths is None:
        text = (
            f"the emitter {cell.krl.emitter!r} does not know how the joints move between the "
            "points: effects that follow the motion cannot be compensated"
        )
        raise EmitError("CMP007", text, SourceRef(cell.path))
    motion = motions_of(plan, paths.trace.is_cp, paths.q)
    if motion is None:
        text = "the program is not that of the plan"
        raise EmitError("CMP004", text, SourceRef(plan.toolpath.path))
    return paths, motion
