"""Two listings side by side: aligned, and compared field by field."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.comparison.align import Lines, align
from postproc.comparison.difference import Difference
from postproc.comparison.listing import listing
from postproc.comparison.manifest import about
from postproc.comparison.settings import StateDifference, cam_lines, state_differences
from postproc.comparison.texts import AXES, POSE, externals_text, status_text, target_text
from postproc.controller import Blend, EventWord, Trace, TraceEvent
from postproc.geometry import rotation_angle, rotation_from_abc
from postproc.krl import KrlModule
from postproc.records import dataclass
from postproc.units import DEG, MM

_GRID_MM = 1e-3
"""Targets are rounded to this [mm or deg] for the keys of lines; what it misses is compared."""
_EVENT_KINDS = {
    EventWord.HOOK: "call",
    EventWord.OUTPUT: "io",
    EventWord.DWELL: "wait",
    EventWord.WAIT_FOR: "wait",
    EventWord.HALT: "wait",
    EventWord.CONTROL: "control",
    EventWord.DATA: "data",
    EventWord.OTHER: "other",
}
Placed = tuple[tuple[int, int], Difference]


@dataclass(frozen=True, slots=True)
class Program:
    """A listing with its lines in order: ``motion`` (n,) row of the trace or -1, else ``event``."""

    trace: Trace
    words: tuple[str, ...]
    relative: tuple[str, ...]
    texts: tuple[str, ...]
    """Text of every event, without the digits that do not matter."""
    motion: IndexArray
    event: IndexArray
    ends: tuple[tuple[str, int, tuple[str, int]], ...]
    """What is in force behind the last motions; see ``Listing``."""
    cam: IndexArray
    """(m,) CAM line that the comment of a motion names, 0 without one."""
    about: dict[str, Any]
    """Its frames and the ids of its tags, see ``about``."""

    def place(self, line: int) -> tuple[str, int]:
        """Return file and line in the file."""
        row = int(self.motion[line])
        if row >= 0:
            return self.trace.place(row)
        return self.trace.place_of(self.trace.events[int(self.event[line])])


def program_of(modules: Sequence[KrlModule], name: str, inline: bool) -> Program:
    """Return a module as lines to compare; a module without routines gives its data."""
    made = listing(modules, name, inline)
    trace = made.trace
    texts = tuple(_text(event, name.upper()) for event in trace.events)
    m, k = len(trace), len(trace.events)
    order = np.concatenate([np.arange(m) + 0.5, np.array([e.motion for e in trace.events])])
    order = np.argsort(order, kind="stable")
    motion = np.concatenate([np.arange(m), np.full(k, -1)])[order]
    event = np.concatenate([np.full(m, -1), np.arange(k)])[order]
    known = cam_lines(modules, trace), about(trace.files, modules)
    return Program(trace, made.words, made.relative, texts, motion, event, made.ends, *known)


def _text(event: TraceEvent, own: str) -> str:
    """Return what an event says; a name that begins with the program's own stands for itself."""
    name = event.name
    if event.word is EventWord.HOOK:
        name = "*" + name[len(own) :] if name.upper().startswith(own) else name
        inner = ",".join(_plain(argument) for argument in event.arguments)
        return f"{name}({inner})" if event.arguments or "(" not in name else name
    if event.word in (EventWord.OUTPUT, EventWord.DWELL):
        value = "" if np.isnan(event.value) else f" {event.value:.6g}"
        return f"{name}{value}"
    return name


def _plain(value: object) -> str:
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    return f"{value:.6g}" if isinstance(value, int | float) else str(value)


# ---------------------------------------------------------------------------------- comparison


@dataclass(frozen=True, slots=True)
class Compared:
    """Two programs motion by motion: (p,) pairs that were taken for one, in order.

    ``old_motion``, ``new_motion`` (p,): rows of the traces; ``distance`` [m], ``turn`` [rad] (p,):
    between their targets; ``state`` (p,): row of ``states``, what differs in the controller's
    state there.
    """

    old: Program
    new: Program
    old_motion: IndexArray
    new_motion: IndexArray
    distance: FloatArray
    turn: FloatArray
    state: IndexArray
    states: tuple[tuple[StateDifference, ...], ...]


def differences(
    old: Program, new: Program, position: float, angle_deg: float, speed: float
) -> tuple[list[Difference], Compared]:
    """Return the differences of two programs in the order of the old one.

    Up to ``position`` [m] and ``angle_deg`` a target (an axis) is the same, up to the share
    ``speed`` a number of the state.
    """
    pairs = align(*_lines(old, new))
    comparer = _Comparer(old, new, position, angle_deg, speed, pairs)
    found = [*_alone(old, new, pairs), *comparer.run()]
    return [entry for _, entry in sorted(found, key=lambda item: item[0])], comparer.compared


def _lines(old: Program, new: Program) -> tuple[Lines, Lines]:
    keys: dict[object, int] = {}
    words: dict[str, int] = {}
    return _columns(old, keys, words), _columns(new, keys, words)


def _columns(program: Program, keys: dict[object, int], words: dict[str, int]) -> Lines:
    trace = program.trace
    n = len(program.motion)
    key, group = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    word, numbers = np.zeros(n, dtype=np.int64), np.zeros((n, 6))
    is_motion = program.motion >= 0
    rows = program.motion[is_motion]
    target = _file_units(trace)[rows]
    numbers[is_motion] = np.nan_to_num(target)
    group[is_motion] = np.where(trace.is_axes[rows], 1, 0)
    word[is_motion] = [words.setdefault(program.words[r], len(words)) for r in rows.tolist()]
    rounded = np.rint(numbers[is_motion] / _GRID_MM).astype(np.int64)
    packed = np.column_stack([word[is_motion], group[is_motion], rounded]).tobytes()
    size = 8 * (2 + 6)
    key[is_motion] = [
        keys.setdefault(packed[at : at + size], len(keys)) for at in range(0, len(packed), size)
    ]
    for line in np.flatnonzero(~is_motion).tolist():
        row = int(program.event[line])
        kind = _EVENT_KINDS[trace.events[row].word]
        key[line] = keys.setdefault((kind, program.texts[row]), len(keys))
        group[line] = 2 + list(_EVENT_KINDS.values()).index(kind)
    return Lines(key, group, word, numbers)


def _file_units(trace: Trace) -> FloatArray:
    """Return the targets (m, 6) in mm and degrees."""
    first = np.where(trace.is_axes, DEG, MM)[:, None]
    return np.hstack([trace.target[:, :3] / first, trace.target[:, 3:] / DEG])


def _alone(old: Program, new: Program, pairs: tuple[IndexArray, IndexArray]) -> Iterator[Placed]:
    """Yield lines that only one program has, ordered by where they belong in the old one."""
    for program, taken, is_old in ((old, pairs[0], True), (new, pairs[1], False)):
        alone = np.ones(len(program.motion), dtype=np.bool_)
        alone[taken] = False
        for line in np.flatnonzero(alone).tolist():
            file, number = program.place(line)
            place = line if is_old else _place_in_old(pairs, line)
            yield (place, 0 if is_old else 1), _one_sided(program, line, file, number, is_old)


def _place_in_old(pairs: tuple[IndexArray, IndexArray], line: int) -> int:
    before = int(np.searchsorted(pairs[1], line))
    return int(pairs[0][before - 1]) if before else -1


def _one_sided(program: Program, line: int, file: str, number: int, is_old: bool) -> Difference:
    row = int(program.motion[line])
    if row >= 0:
        kind = "removed" if is_old else "inserted"
        detail = f"{program.words[row]} to {target_text(program.trace, row)}"
    else:
        event = int(program.event[line])
        kind = _EVENT_KINDS[program.trace.events[event].word]
        detail = f"{'removed' if is_old else 'added'} {program.texts[event]}"
    return Difference.of(kind, detail, file, number, is_old=is_old)


class _Comparer:
    """Compares lines that were taken for one."""

    def __init__(
        self,
        old: Program,
        new: Program,
        position: float,
        angle_deg: float,
        speed: float,
        pairs: tuple[IndexArray, IndexArray],
    ) -> None:
        self.old, self.new = old, new
        self._position, self._angle, self._speed = position, angle_deg * DEG, speed
        self._old_targets = _file_units(old.trace).tolist()
        self._new_targets = _file_units(new.trace).tolist()
        self._is_axes = old.trace.is_axes.tolist()
        is_motion = old.motion[pairs[0]] >= 0
        self._left, self._right = pairs[0][is_motion], pairs[1][is_motion]
        self._texts = tuple(side[~is_motion].tolist() for side in pairs)
        i, j = old.motion[self._left], new.motion[self._right]
        state, states = self._states(i, j)
        self.compared = Compared(old, new, i, j, *self._shifts(i, j), state, states)

    def run(self) -> Iterator[Placed]:
        """Yield the differences of paired lines."""
        pairs = self.compared
        i, j, off, turned = pairs.old_motion, pairs.new_motion, pairs.distance, pairs.turn
        otherwise = self._otherwise(i, j)
        moved = (off > self._position) | (turned > self._angle)
        columns = (self._left, self._right, i, j, off, turned, otherwise)
        rows = np.flatnonzero(moved | otherwise)
        for line, other, a, b, way, angle, more in zip(
            *(column[rows].tolist() for column in columns), strict=True
        ):
            number = 2
            if way > self._position or angle > self._angle:
                yield (line, number), self._placed(self._moved(a, b, way, angle), line, other)
            for entry in self._motion(a, b) if more else ():
                number += 1
                yield (line, number), self._placed(entry, line, other)
        yield from self._state_entries()
        for line, other in zip(*self._texts, strict=True):
            event = int(self.old.event[line])
            before, after = self.old.texts[event], self.new.texts[int(self.new.event[other])]
            if before != after:
                word = self.old.trace.events[event].word
                yield (
                    (line, 2),
                    self._placed(_entry(_EVENT_KINDS[word], before, after), line, other),
                )

    # ------------------------------------------------------------------------------- the state

    def _states(
        self, i: IndexArray, j: IndexArray
    ) -> tuple[IndexArray, tuple[tuple[StateDifference, ...], ...]]:
        """Return what differs in the state at pairs (p,), as rows (p,) of a table."""
        rows = np.column_stack([self.old.trace.setting[i], self.new.trace.setting[j]])
        pairs, inverse = np.unique(rows, axis=0, return_inverse=True)
        return inverse.reshape(-1), tuple(self._state(*pair) for pair in pairs.tolist())

    def _state(self, a: int, b: int) -> tuple[StateDifference, ...]:
        old, new = self.old.trace, self.new.trace
        return state_differences(old, new, old.settings[a], new.settings[b], self._speed)

    def _state_entries(self) -> Iterator[Placed]:
        """Yield what differs in the state: where it begins, with the motions that have it."""
        state, states = self.compared.state, self.compared.states
        starts = np.flatnonzero(np.diff(state, prepend=-1)).tolist()
        lengths = np.diff([*starts, len(state)]).tolist()
        held = [states[int(state[start])] for start in starts]
        for k, start in enumerate(starts):
            for item in held[k]:
                if k and item in held[k - 1]:
                    continue
                stop = next((n for n in range(k, len(held)) if item not in held[n]), len(held))
                motions = sum(lengths[k:stop])
                entry = Difference(item.kind, f"{item}, {motions} motions")
                line, other = int(self._left[start]), int(self._right[start])
                yield (line, 1000), self._placed(entry, line, other)
        told = {item for items in states for item in items}
        ends = {name: (row, place) for name, row, place in self.new.ends}
        for name, row, place in self.old.ends:
            for item in self._state(row, ends[name][0]) if name in ends else ():
                if item not in told:
                    entry = Difference(item.kind, f"{item} behind the last motion")
                    yield (len(self.old.motion), 0), _put(entry, place, ends[name][1])

    def _placed(self, entry: Difference, line: int, other: int) -> Difference:
        return _put(entry, self.old.place(line), self.new.place(other))

    def _shifts(self, i: IndexArray, j: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Return how far targets are apart (p,) [m] and turned (p,) [rad], NaN parts as equal."""
        a, b = self.old.trace.target[i], self.new.trace.target[j]
        axes = self.old.trace.is_axes[i]
        off = np.where(axes, 0.0, np.linalg.norm(np.nan_to_num(a[:, :3] - b[:, :3]), axis=1))
        turned = np.where(axes, np.abs(np.nan_to_num(a - b)).max(axis=1, initial=0.0), 0.0)
        rows = np.flatnonzero(
            ~axes & (np.abs(np.nan_to_num(a[:, 3:] - b[:, 3:])) > 0.0).any(axis=1)
        )
        if len(rows):
            R_a = rotation_from_abc(np.nan_to_num(a[rows, 3:]))
            R_b = rotation_from_abc(np.nan_to_num(b[rows, 3:]))
            turned[rows] = rotation_angle(R_a, R_b)
        partial = np.isnan(a) != np.isnan(b)
        off[partial[:, :3].any(axis=1)] = np.inf
        turned[partial[:, 3:].any(axis=1)] = np.inf
        return off, turned

    def _otherwise(self, i: IndexArray, j: IndexArray) -> Any:  # noqa: ANN401 - a boolean array
        """Return which pairs may differ in anything but their target."""
        old, new = self.old.trace, self.new.trace
        differ = (old.status[i] != new.status[j]) | (old.turn[i] != new.turn[j])
        differ |= (old.blend[i] != new.blend[j]) | (old.motion_type[i] != new.motion_type[j])
        e, f = old.external[i], new.external[j]
        differ |= ((np.isnan(e) != np.isnan(f)) | (np.abs(np.nan_to_num(e - f)) > 0.0)).any(axis=1)
        special = [*old.auxiliary, *old.angle]
        differ |= np.isin(i, special) | np.isin(j, [*new.auxiliary, *new.angle])
        for ours, theirs in (
            (self.old.words, self.new.words),
            (self.old.relative, self.new.relative),
        ):
            differ |= np.array(ours, dtype=str)[i] != np.array(theirs, dtype=str)[j]
        return differ

    def _motion(self, i: int, j: int) -> Iterator[Difference]:
        """Yield what differs beside the target."""
        old, new = self.old.trace, self.new.trace
        if self.old.words[i] != self.new.words[j]:
            yield _entry("motion", self.old.words[i], self.new.words[j])
        if self.old.relative[i] != self.new.relative[j]:
            yield _entry("motion", f"#{self.old.relative[i]}", f"#{self.new.relative[j]}")
        yield from self._arc(i, j)
        s, t = (int(old.status[i]), int(old.turn[i])), (int(new.status[j]), int(new.turn[j]))
        if s != t:
            yield _entry("status", status_text(*s), status_text(*t))
        if old.blend[i] != new.blend[j]:
            before, after = Blend(int(old.blend[i])), Blend(int(new.blend[j]))
            yield _entry("approximation", before.name.lower(), after.name.lower())
        if not np.array_equal(old.external[i], new.external[j], equal_nan=True):
            e, f = np.nan_to_num(old.external[i]), np.nan_to_num(new.external[j])
            if np.abs(e - f).max() > self._position / MM:
                yield _entry("external", externals_text(e), externals_text(f))

    def _moved(self, i: int, j: int, off: float, turned: float) -> Difference:
        parts: list[str] = []
        distance = off / MM if self._position < off < math.inf else None
        angle = turned / DEG if self._angle < turned < math.inf else None
        if off > self._position:
            parts.append("other coordinates" if distance is None else f"{distance:.4f} mm")
        if turned > self._angle:
            parts.append("other angles" if angle is None else f"{angle:.4f} deg")
        before, after = self._old_targets[i], self._new_targets[j]
        names = AXES if self._is_axes[i] else POSE
        target = " ".join([f"{n} {v:.3f}" for n, v in zip(names, after, strict=True)])
        places = None if self._is_axes[i] else (tuple(before[:3]), tuple(after[:3]))
        text = f"by {' and '.join(parts)} to {target}"
        return Difference("moved", text, distance_mm=distance, angle_deg=angle, position_mm=places)

    def _arc(self, i: int, j: int) -> Iterator[Difference]:
        """Compare auxiliary point and arc angle of circular motions."""
        a, b = self.old.trace.auxiliary.get(i), self.new.trace.auxiliary.get(j)
        if a is not None and b is not None:
            off = float(np.linalg.norm(a[:3] - b[:3]))
            if off > self._position:
                text = f"auxiliary point by {off / MM:.4f} mm"
                yield Difference("moved", text, distance_mm=off / MM)
        angles = self.old.trace.angle.get(i), self.new.trace.angle.get(j)
        if angles[0] != angles[1]:
            texts = ["no CA" if v is None else f"CA {v / DEG:.4f}" for v in angles]
            yield _entry("moved", texts[0], texts[1])


def _entry(kind: str, before: str, after: str) -> Difference:
    return Difference(kind, f"{before} became {after}")


def _put(entry: Difference, old: tuple[str, int], new: tuple[str, int]) -> Difference:
    return replace(entry, old_file=old[0], old_line=old[1], new_file=new[0], new_line=new[1])
