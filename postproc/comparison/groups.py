"""Differences as a reviewer reads them: by object, with their cause, worst first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.comparison import listed as beside
from postproc.comparison.difference import (
    KINDS,
    NAMED,
    Difference,
    DiffTolerance,
    Group,
    names,
    tidy,
    vector,
    xyz,
)
from postproc.comparison.lines import Compared
from postproc.comparison.objects import Matched, Place, Shift, match, places_of, tool_axis
from postproc.geometry import rotation_angle
from postproc.units import DEG

_MM_MIN = 60_000.0
_WRIST = 10.0
"""A turn of the tool turns the joints of the wrist by so many times as much, 6 deg off singular."""
_FLIP = 1.0 * DEG
"""A wrist whose A5 is nearer to 0 has no side."""


def groups_of(
    differences: Sequence[Difference], compared: Sequence[Compared], tolerance: DiffTolerance
) -> tuple[Group, ...]:
    """Return the groups of the differences, worst first; none if there are no differences."""
    if not differences:
        return ()
    reviews = [_Review(pair, tolerance) for pair in compared]
    found = []
    for review in reviews:
        own = list(review.groups())
        name = "" if len(reviews) == 1 else Path(review.pair.old.trace.files[0]).stem
        found += [group.of_program(name) if name else group for group in own]
    found = [*(group for group in found if group.kind != "spin"), *beside.one_spin(found)]
    found += beside.listed(differences, compared, {group.kind for group in found})
    places = sum(len(review.matched.pairs) for review in reviews)
    told = beside.with_cause(found, places)
    return tuple(sorted(told, key=lambda group: KINDS.index(group.kind)))


class _Review:
    """One program against another, place by place."""

    def __init__(self, compared: Compared, tolerance: DiffTolerance) -> None:
        self.pair, self.limits = compared, tolerance
        self.old, self.new = (
            places_of(side, has_home=beside.home_of(side) is not None)
            for side in (compared.old, compared.new)
        )
        self.about = [side.about for side in (compared.old, compared.new)]
        self.axis = tool_axis(self.old, self.new, compared)
        self.matched: Matched = match(self.old, self.new, self.axis, compared)
        self.home: list[Group] = list(beside.changed_homes(compared, tolerance.angle_deg))

    def groups(self) -> Iterator[Group]:
        """Yield what differs, by kind."""
        yield from beside.changed_frames(self.pair, *self.about)
        yield from self.home
        yield from self._order()
        for kind, places, rows in (
            ("removed", self.old, self.matched.removed),
            ("added", self.new, self.matched.added),
        ):
            if rows:
                ids = [self._name(places[k], is_new=kind == "added") for k in rows]
                at = xyz(places[rows[0]].points[places[rows[0]].deepest(self.axis)])
                text = f"{len(ids)} {_noun([places[k] for k in rows])} {kind}: {names(ids)}"
                worst = {"id": ids[0], "position_mm": at}
                yield Group(kind, len(ids), tuple(ids), worst, f"{text}, at {vector(at)}")
        yield from self._where()
        yield from self._feeds()
        yield from self._how()

    def _name(self, place: Place, *, is_new: bool = False) -> str:
        """Return a place by its id or CAM line, else by its line in the program."""
        trace = (self.pair.new if is_new else self.pair.old).trace
        known = self.about[is_new].get("ids", {}).get(str(place.cam))
        line = f"CAM line {place.cam}" if place.cam else f"line {trace.line[place.path[0]]}"
        return str(known or line)

    def _order(self) -> Iterator[Group]:
        swapped = self.matched.swapped
        if not swapped:
            return
        where = dict(self.matched.pairs)
        back = {j: i for i, j in where.items()}
        exchanged = [(i, where[i]) for i in where if where.get(where[i]) == i and i < where[i]]
        ids = [self._name(self.old[i]) for i, _ in swapped]
        text = f"{len(ids)} {_noun([self.old[i] for i, _ in swapped])} in another order, "
        text += f"nothing else about them: {names(ids)}"
        is_pure = len(self.old) == len(self.new) and len(back) == len(where)
        others = {k for pair in exchanged for k in pair}
        if is_pure and exchanged and {i for i, j in where.items() if i != j} == others:
            ids = [self._name(self.old[k]) for pair in exchanged for k in pair]
            both = [f"{a} and {b}" for a, b in zip(ids[::2], ids[1::2], strict=True)]
            text = f"{'; '.join(both[:NAMED])} swapped, same {_noun(self.old)}"
            text += f"; {len(both) - NAMED} more swaps" if len(both) > NAMED else ""
        yield Group("order", len(ids), tuple(ids), {"id": ids[0]}, text)

    # ------------------------------------------------------------------------ where and how deep

    def _where(self) -> Iterator[Group]:
        """Yield what was moved, and what goes deeper or is approached from another height."""
        moved: list[tuple[Place, Place, Shift]] = []
        along: dict[tuple[str, float], list[str]] = {}
        counts: dict[str, list[str]] = {}
        for i, j in self.matched.pairs:
            a, b = self.old[i], self.new[j]
            shift = Shift.of(a, b, self.axis)
            if shift.is_moved(self.limits):
                moved.append((a, b, shift))
            elif abs(shift.deeper) > self.limits.position_mm:
                key = "depth", round(shift.deeper, 3)
                along.setdefault(key, []).append(self._name(a))
            elif abs(shift.further) > self.limits.position_mm:
                key = "approach height", round(-shift.further, 3)
                along.setdefault(key, []).append(self._name(a))
            lower = [p.highest(self.axis)[1] for p in (a, b)]
            if lower[0] != lower[1]:
                text = f"{lower[0]} strokes became {lower[1]}"
                counts.setdefault(text, []).append(self._name(a))
        yield from self._moved(moved)
        for (what, change), ids in sorted(along.items(), key=lambda item: -abs(item[0][1])):
            text = f"{what} {change:+g} mm along the tool: {names(ids)}"
            worst = {"id": ids[0], "change_mm": change}
            yield Group("process", len(ids), tuple(ids), worst, text)
        for text, ids in counts.items():
            worst = {"id": ids[0]}
            yield Group("process", len(ids), tuple(ids), worst, f"{text}: {names(ids)}")

    def _how(self) -> Iterator[Group]:
        """Yield other postures, and turns about the tool axis."""
        flips: list[str] = []
        detours: list[str] = []
        spins: list[tuple[float, str, int]] = []
        turned: list[tuple[float, str, int]] = []
        for i, j in self.matched.pairs:
            a, b = self.old[i], self.new[j]
            name = self._name(a)
            before, after = self._joints(a, b)
            by_joints = float(np.abs(before - after).max(initial=0.0)) / DEG
            count = len(b.path) + len(b.joints)
            lower = [p.highest(self.axis)[1] for p in (a, b)]
            if lower[0] == lower[1] and len(a.joints) + len(a.path) != count:
                detours.append(name)
            if _flipped(before, after):
                flips.append(name)
            elif not Shift.of(a, b, self.axis).is_moved(self.limits):
                turn = float(rotation_angle(a.R[-1], b.R[-1])) / DEG
                is_one = self.limits.angle_deg < by_joints <= _WRIST * self.limits.angle_deg
                if turn > self.limits.angle_deg or is_one:
                    spins.append((turn, name, count))
                elif by_joints > self.limits.angle_deg:
                    turned.append((by_joints, name, count))
        yield from self._joints_alone(turned)
        for ids, what in (
            (flips, "the arm has another posture at"),
            (detours, "the arm goes another way to"),
        ):
            if ids:
                yield Group("posture", len(ids), tuple(ids), {"id": ids[0]}, f"{what} {names(ids)}")
        if spins:
            turn, name, _ = max(spins, key=lambda item: item[0])
            count = sum(item[2] for item in spins)
            worst = {"id": name, "angle_deg": round(turn, 4)}
            yield Group("spin", count, tuple(item[1] for item in spins), worst, "")

    def _joints_alone(self, turned: list[tuple[float, str, int]]) -> Iterator[Group]:
        """Yield joint motions that end elsewhere although their places are as before."""
        if not turned:
            return
        angle, worst, _ = max(turned)
        ids = tuple(name for _, name, _ in turned)
        size = {"id": worst, "angle_deg": tidy(angle)}
        is_all = 2 * len(turned) > len(self.matched.pairs)
        text = f"joint targets moved by up to {angle:.4g} deg, the path behind them as before: "
        text += beside.NOT_HERE if is_all else names(ids)
        kind, count = ("cell" if is_all else "posture"), sum(count for _, _, count in turned)
        yield Group(kind, count, ids, size, text)

    def _moved(self, moved: list[tuple[Place, Place, Shift]]) -> Iterator[Group]:
        if not moved:
            return
        moved = sorted(moved, key=lambda item: (-item[2].size, item[0].cam))
        ids = [self._name(place) for place, _, _ in moved]
        worst = moved[0][2]
        along, across = abs(tidy(worst.deeper)), tidy(worst.across)
        amounts = {"along_mm": along, "across_mm": across, "tilt_deg": tidy(worst.tilt_deg)}
        step = xyz(worst.xyz)
        text = f"{names(ids)} moved by {vector(step)} mm"
        if len(ids) > 1:
            off = max(float(np.abs(item[2].xyz - worst.xyz).max()) for item in moved)
            how = "all" if off <= self.limits.position_mm else f"{ids[0]} most,"
            text = f"{len(ids)} {_noun([item[0] for item in moved])} moved, {how} by "
            text += f"{vector(step)} mm: {names(ids)}"
        if self.axis.any():
            text += f"; {along:g} mm along and {across:g} mm across the tool"
        text += f", tilted by {worst.tilt_deg:.4g} deg" if worst.tilt_deg else ""
        steps = dict(zip(("dx_mm", "dy_mm", "dz_mm"), step, strict=True))
        yield Group("moved", len(ids), tuple(ids), {"id": ids[0], **steps, **amounts}, text)

    def _joints(self, a: Place, b: Place) -> tuple[FloatArray, FloatArray]:
        """Return the joint targets (k, 6) to two places [rad], as far as both have some."""
        count = min(len(a.joints), len(b.joints))
        old, new = self.pair.old.trace, self.pair.new.trace
        before, after = a.joints[len(a.joints) - count :], b.joints[len(b.joints) - count :]
        return np.nan_to_num(old.target[before]), np.nan_to_num(new.target[after])

    # --------------------------------------------------------------------------------- the speed

    def _feeds(self) -> Iterator[Group]:
        old, new = (side.trace.column("speed") for side in (self.pair.old, self.pair.new))
        found: dict[tuple[bool, float, float], list[str]] = {}
        for i, j in self.matched.pairs:
            a, b = self.old[i], self.new[j]
            if len(a.path) != len(b.path):
                continue
            slow, fast = old[a.path], new[b.path]
            for k in np.flatnonzero(np.abs(slow - fast) > self.limits.speed * slow).tolist():
                key = k == a.deepest(self.axis), float(slow[k]), float(fast[k])
                found.setdefault(key, []).append(self._name(a))
        for (is_feed, *speeds), places in sorted(found.items(), key=_by_speed):
            ids = tuple(dict.fromkeys(places))
            before, after = (float(f"{speed * _MM_MIN:.6g}") for speed in speeds)
            text = f"{'feed' if is_feed else 'path speed'} {before:g} became {after:g} mm/min: "
            worst = {"id": ids[0], "old_mm_min": before, "new_mm_min": after}
            yield Group("process", len(places), ids, worst, text + names(ids))


def _by_speed(item: tuple[tuple[bool, float, float], list[str]]) -> tuple[bool, float]:
    """Feeds before the other speeds, the largest change first."""
    is_feed, before, after = item[0]
    return not is_feed, min(before, after) / max(before, after, 1e-12)


def _flipped(a: FloatArray, b: FloatArray) -> bool:
    """Whether joint targets (k, 6) [rad] are no neighbours: other side of the wrist, or turns."""
    wrist = (a[:, 4] * b[:, 4] < 0.0) & (np.minimum(np.abs(a[:, 4]), np.abs(b[:, 4])) > _FLIP)
    return bool(wrist.any() or (np.abs(a - b) > np.pi).any())


def _noun(places: Sequence[Place]) -> str:
    what = "hole" if all(len(place.path) > 1 for place in places) else "point"
    return what if len(places) == 1 else f"{what}s"
