"""Whether the program goes to every tag of the CAM file, in order, with the tool axis asked for.

A point that the program does not go to is *missed*; if it goes there at another time, it is out of
*order*. Both count with the distance to where the program does go between the neighbours. The tool
axis must be the file's, or tilted against it as the cell allows (see ``tilt``). Points that
``[motion] thin`` lets it pass are held against the way that is driven there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import RunKind
from postproc.units import DEG, MM
from postproc.verification.cam.match import Match
from postproc.verification.report import AT_MOST, Measure, Remark, Said, listed
from postproc.verification.run import Run


def check_points(run: Run, match: Match) -> Iterator[Said]:
    """Measure and judge points and axes of the tags that motions go to."""
    tags, off, tolerances = match.tags, match.off, match.tolerances
    found = np.flatnonzero(tags.first >= 0)
    missed = np.flatnonzero((tags.first < 0) & (off.motion >= 0))
    if len(missed):  # worse than all others; told where the program is by then
        worst = int(missed[int(off.position[missed].argmax())])
        before = max(int(tags.first[: worst + 1].max()), 0)
        yield Measure("position", float(off.position[worst] / MM), "mm", before)
    if not len(found):
        return
    measures = [("position", off.position, MM, "mm")] * (not len(missed))
    measures += [("axis", off.axis, DEG, "deg")]
    measures += [("tilt", off.tilt, DEG, "deg")] * bool(match.tilts.allowed)
    for name, values, size, unit in measures:
        row = int(found[int(values[found].argmax())])
        yield Measure(name, float(values[row] / size), unit, int(tags.first[row]))
    bad = found[off.axis[found] > tolerances.axis]
    for row, more in listed(bad, "tags", off.axis):
        text = f"the tool axis is {off.axis[row] / DEG:.4f} deg off at {tags.name(row)}"
        yield Remark(RunKind.AXIS, int(tags.first[row]), text + more)
    bad = found[off.position[found] > tolerances.position]
    for row, more in listed(bad, "tags", off.position):
        kind, text = _how(match, row)
        yield Remark(kind, int(tags.first[row]), f"{tags.name(row)}: {text}{more}")


def check_missed(run: Run, match: Match) -> Iterator[Said]:
    """Yield tags that no motion goes to, with how far off the program is there."""
    tags, off, station = match.tags, match.off, run.paths.station
    missed = np.flatnonzero(tags.first < 0)
    for row in missed[(off.motion[missed] < 0) & (missed == 0)].tolist():
        text = f"{tags.name(row)}: the program makes no motion at all"
        yield Remark(RunKind.MISSED, None, text)
    assigned = match.assigned
    for row, more in listed(missed, "tags"):
        nearest = int(off.motion[row])
        if nearest < 0:
            continue
        kind, text = _how(match, row)
        used = int(station.tool[nearest]), int(station.base[nearest])
        asked = int(assigned.tool[row]), int(assigned.base[row])
        if used != asked and off.position[row] <= match.tolerances.position:
            kind, text = RunKind.TOOL, _other_tool(run, used, asked)
        yield Remark(kind, nearest, f"{tags.name(row)}: {text}{more}")


def check_passed(run: Run, match: Match) -> Iterator[Said]:
    """Yield tags that are passed farther off than the cell allows."""
    thin, passed = run.cell.motion.thin, match.passed
    if thin is None:
        return
    chord = thin.chord + match.allowed_off
    excess = np.maximum(passed.chord / chord, passed.axis_error / thin.axis)
    for place, more in listed(np.flatnonzero(excess > 1.0), "tags", excess):
        way, turn = passed.chord[place], passed.axis_error[place]
        name = match.every.name(int(passed.tag[place]))
        text = f"{name}: passed {way / MM:.4f} mm and {turn / DEG:.4f} deg off"
        allowed = f"{chord / MM:g} mm and {thin.axis / DEG:g} deg are allowed"
        kind = RunKind.POSITION if way > chord else RunKind.AXIS
        yield Remark(kind, int(passed.motion[place]), f"{text}, {allowed}{more}")


def check_again(_run: Run, match: Match) -> Iterator[Said]:
    """Yield holes that are drilled more often than the file asks for."""
    for again in match.again[:AT_MOST]:
        name = match.every.name(int(np.argsort(match.order)[again.tag]))
        text = f"{name}: drilled {again.times} times, the CAM file asks for fewer"
        yield Remark(RunKind.ORDER, again.motion, text)


def _other_tool(run: Run, used: tuple[int, int], asked: tuple[int, int]) -> str:
    """Return which tool and base go there instead of those that the file means."""
    words = [
        f"tool {run.cell.tools[tool].number} in base {run.cell.bases[base].number}"
        for tool, base in (used, asked)
        if tool >= 0 and base >= 0
    ]
    wanted = " ".join(words[1:]) or "no such tool"
    return f"{words[0]} goes there, the file asks for {wanted}"


def _how(match: Match, row: int) -> tuple[RunKind, str]:
    """Return kind and words for a tag that was not served."""
    wanted, tolerance = match.tags.wanted, match.tolerances.position
    visited: FloatArray = match.real.visited[match.real.case[row]]
    off = visited[match.off.motion[row]] - wanted.point[row]
    distance = float(np.linalg.norm(off))
    anywhere = float(np.linalg.norm(visited - wanted.point[row], axis=1).min())
    beside = wanted.point[[max(row - 1, 0), min(row + 1, len(wanted.point) - 1)]]
    apart = np.linalg.norm(beside - wanted.point[row], axis=1)
    # a motion nearer than half the way to the next tag is this one's; strokes near a hole are not
    own = 0.5 * float(np.min(apart[apart > 0.0], initial=np.inf))
    is_own = distance <= own and not wanted.depth[row] > 0.0
    if anywhere <= tolerance and not is_own:
        return RunKind.ORDER, "the program goes there, but not in the order of the CAM file"
    if wanted.depth[row] > 0.0:
        along = float(off @ wanted.axis[row])
        side = float(np.linalg.norm(off - along * wanted.axis[row]))
        if side <= 10.0 * tolerance < 10.0 * abs(along):
            where = "deeper" if along > 0.0 else "higher"
            return RunKind.DEPTH, f"the hole ends {abs(along) / MM:.3f} mm {where} than asked"
    return RunKind.POSITION, f"the program comes no nearer than {distance / MM:.4f} mm"
