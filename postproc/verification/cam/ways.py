"""Whether the ways from tag to tag are those of the CAM file: lines, arcs, the tool axis on them.

- A rapid: any way will do (collisions are another check).
- A line or an arc: its whole length must be run by path motions within the path tolerance; the
  tool may leave and come back by joint motions or along its axis (see ``elements.follow``).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import RunKind
from postproc.geometry import angle_between, onto_line
from postproc.units import DEG, MM
from postproc.verification.cam.elements import Arc, Followed, Line, element_to
from postproc.verification.cam.match import Match
from postproc.verification.report import AT_MOST, Measure, Remark, Said, listed
from postproc.verification.run import Run

BETWEEN = 0.5 * DEG
"""By so much [rad] lead and side tilt may leave their range between two tags."""
BENT = 0.25
"""Share of the turn of the tool axis by which it may be beside the shortest one."""
_UPRIGHT = 0.01 * DEG
_ON_THE_SPOT = 2e-6
"""Where on a shorter way [m] a sample lies cannot be told: program text has 0.1 um."""


def check_ways(run: Run, match: Match) -> Iterator[Said]:
    """Measure and judge how lines and arcs between served tags are run."""
    tags, ways, limit = match.tags, match.ways, match.path_tolerance
    behind = ways.behind[~run.paths.trace.is_cp[tags.first[ways.behind]]]
    for row in behind[:AT_MOST].tolist():
        text = f"to {tags.name(row)}: a joint motion, the CAM file asks for a line"
        yield Remark(RunKind.PATH, int(tags.first[row]), text)
    bent, texts = _bent(run, match)
    yield from texts
    done = [*([] if bent is None else [bent]), *ways.followed.values()]
    if done:
        worst = max(done, key=lambda followed: followed.deviation)
        yield Measure("path", worst.deviation / MM, "mm", worst.motion)
    wrong = [(row, way) for row, way in ways.followed.items() if way.is_wrong(limit)]
    for row, way in wrong[:AT_MOST]:
        text = way.fault or f"{way.deviation / MM:.4f} mm off the path"
        yield Remark(RunKind.PATH, way.motion, f"to {tags.name(row)}: {text}")


def check_turns(run: Run, match: Match) -> Iterator[Said]:
    """Yield where the tool axis, in the middle of a cut, is not between those of its two tags.

    Beside the shortest turn from one to the other by no more than a share of it: the turn about the
    tool's own axis bends the way. Where the cell allows tilt, it holds between the tags as well.
    """
    if match.tilts.allowed:
        yield from _tilted_between(run, match)
        return
    covered = match.ways.covered.items()
    inner = [(motion, row) for row, motions in covered for motion in motions[:-1]]
    if not inner:
        return
    motion, row = np.array(inner).T
    axis, wanted = run.paths.end_axis[motion], match.tags.wanted.axis
    turn = angle_between(wanted[row - 1], wanted[row])
    both = angle_between(axis, wanted[row - 1]) + angle_between(axis, wanted[row])
    off = 0.5 * (both - turn)
    bad = np.flatnonzero(off > match.tolerances.axis + BENT * turn)
    for place, more in listed(bad, "tags", off):
        text = f"the tool axis is {off[place] / DEG:.4f} deg off those of the cut's ends"
        yield Remark(RunKind.AXIS, int(motion[place]), text + more)


def _tilted_between(run: Run, match: Match) -> Iterator[Remark]:
    """Yield where the tool leaves the allowed tilt between two tags."""
    paths, tilt, found = run.paths, match.off.tilt, []
    for row, covered in match.ways.covered.items():
        if not covered or (len(covered) == 1 and max(tilt[row - 1], tilt[row]) < _UPRIGHT):
            continue
        element = element_to(match.tags.toolpath, row)
        low, high = np.searchsorted(paths.row, [covered[0], covered[-1] + 1])
        samples = np.arange(low, high)[np.isin(paths.row[low:high], covered)]
        samples = samples[np.isfinite(paths.axis[samples, 0])]
        if not len(samples) or element.length < _ON_THE_SPOT:
            continue
        share = _shares(element, paths.point[samples])
        arc = element if isinstance(element, Arc) else None
        beyond = match.tilts.beyond(row, share, paths.axis[samples], arc)
        worst = int(beyond.argmax())
        if beyond[worst] > BETWEEN:
            found.append((float(beyond[worst]), row, int(paths.row[samples[worst]])))
    found.sort(key=lambda item: (-item[0], item[1]))
    more = f", {len(found)} such cuts" if len(found) > AT_MOST else ""
    for value, row, motion in found[:AT_MOST]:
        text = f"on the way to {match.tags.name(row)} the tool axis is {value / DEG:.4f} deg off"
        yield Remark(RunKind.AXIS, motion, text + more)


def _shares(element: Line | Arc, points: FloatArray) -> FloatArray:
    """Return how far (k,) along an element points (k, 3) are, 0 to 1; they follow each other."""
    if isinstance(element, Line):
        along = element.measure(points, 0.0)[1]
    else:
        along, reached = np.empty(len(points)), 0.0
        for place, point in enumerate(points):
            reached = float(element.measure(point[None], reached)[1][0])
            along[place] = reached
    return np.clip(along / element.length, 0.0, 1.0)


def _bent(run: Run, match: Match) -> tuple[Followed | None, list[Remark]]:
    """Return how far the real tool leaves straight lines that are right at both ends."""
    real, rows, paths = match.real, match.ways.direct, run.paths
    tag = np.full(len(paths), -1)
    tag[match.tags.first[rows]] = rows
    own = tag[paths.row]
    sample = np.flatnonzero((own >= 0) & (paths.share < 1.0))
    if not match.is_real or not len(sample):
        return None, []
    own, progress = own[sample], paths.share[sample, None]
    every = np.stack([some.point for some in real.paths])
    # where the load changes from tag to tag, it does so along the line
    points = (1.0 - progress) * every[real.case[own - 1], sample]
    points = points + progress * every[real.case[own], sample]
    start, end = (np.asarray(match.tags.toolpath.points)[at] for at in (own - 1, own))
    off = np.nan_to_num(onto_line(points, start, end)[1])
    place = int(off.argmax())
    bent = Followed(float(off[place]), int(paths.row[sample[place]]))
    beside = int(np.unique(own[off > match.path_tolerance]).size)
    text = f"the real tool is expected {off[place] / MM:.4f} mm off the line, {beside} lines"
    text = f"to {match.tags.name(int(own[place]))}: {text}"
    return bent, [Remark(RunKind.PATH, bent.motion, text)] * bool(beside)
