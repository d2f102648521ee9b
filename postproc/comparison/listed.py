"""Groups of the differences that are no places: cell, home, events, state, whole programs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence, Set
from dataclasses import replace
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.comparison.difference import Difference, Group, names, tidy
from postproc.comparison.lines import Compared, Program
from postproc.controller import Trace
from postproc.geometry import kuka_from_transform
from postproc.units import DEG

_GROUP_OF = {
    "tool": "cell",
    "base": "cell",
    "speed": "process",
    "call": "process",
    "io": "process",
    "wait": "process",
    "control": "process",
    "motion": "process",
    "external": "posture",
    "status": "posture",
    "moved": "moved",
}
"""Kind of a difference to the kind of its group; the others are the state of the controller."""
_PLACES = frozenset({"moved", "inserted", "removed"})
NOT_HERE = (
    "what changed is not in the program: where the base stands, the TCP, limits, solids or "
    "settings of the cell"
)
_HOME = "home"
_COUNT = re.compile(r", (\d+) motions$")
_FRAME_DATA = re.compile(r"\b(TOOL|BASE|LOAD)_DATA\b|^load ")
_ARC = ("auxiliary point ", "CA ", "no CA ")
_PATH_SPEED = "$VEL.CP "


def listed(
    differences: Sequence[Difference], compared: Sequence[Compared], known: Set[str]
) -> list[Group]:
    """Return the groups of what is not told by places; ``known``: the kinds that these gave."""
    rows: dict[tuple[str, str], list[tuple[Difference, int]]] = {}
    for item in differences:
        is_arc = item.detail.startswith(_ARC)
        if (item.kind in _PLACES and not is_arc) or (
            item.detail.startswith(_PATH_SPEED) and "process" in known
        ):
            continue
        motions = _COUNT.search(item.detail)
        text = _COUNT.sub("", item.detail)
        if item.kind in ("motion", "status", "external"):
            text = f"{item.kind} {text}"
        key = _kind(item), text
        rows.setdefault(key, []).append((item, int(motions.group(1)) if motions else 1))
    total = sum(len(pair.old_motion) for pair in compared)
    found = []
    for (kind, text), items in rows.items():
        count = sum(number for _, number in items)
        text = _with_amount(text, compared)
        if _COUNT.search(items[0][0].detail):
            text += f": {'all ' if count == total else ''}{count} motions"
        elif count > 1:
            text += f", {count} times"
        first = items[0][0]
        worst = {"old_line": first.old_line, "new_line": first.new_line}
        ids = tuple(dict.fromkeys(_line(item) for item, _ in items))
        found.append(Group(kind, count, ids, worst, text))
    left = [item for item in differences if item.kind in _PLACES]
    if left and not known and not found:
        found.append(_rest(left))
    return found


def _kind(item: Difference) -> str:
    if item.kind == "module":
        return "added" if item.detail.endswith("is new") else "removed"
    if _FRAME_DATA.search(item.detail):
        return "cell"
    return _GROUP_OF.get(item.kind, "state")


def _line(item: Difference) -> str:
    is_new = item.old_line is None
    return f"line {item.new_line if is_new else item.old_line}{' of the new one' * is_new}"


def _rest(left: Sequence[Difference]) -> Group:
    """Return the group of motions that belong to no place: programs of joint motions alone."""
    worst = max(left, key=lambda item: (item.distance_mm or 0.0, item.angle_deg or 0.0))
    size = {"distance_mm": worst.distance_mm, "angle_deg": worst.angle_deg}
    text = f"{len(left)} motions differ, the worst: {worst.kind} {worst.detail}"
    return Group("moved", len(left), tuple(map(_line, left)), {"id": _line(worst), **size}, text)


def one_spin(found: Sequence[Group]) -> list[Group]:
    """Return the turns about the tool of all programs as one group."""
    spins = [group for group in found if group.kind == "spin"]
    if not spins:
        return []
    worst = max((group.worst for group in spins), key=lambda item: float(item["angle_deg"]))
    count = sum(group.count for group in spins)
    text = f"{count} motions keep tool point and tool axis and turn about it only, "
    text += f"at most {worst['angle_deg']:.3g} deg, at {worst['id']}"
    ids = tuple(name for group in spins for name in group.ids)
    return [Group("spin", count, ids, worst, text)]


def with_cause(found: Sequence[Group], places: int) -> list[Group]:
    """Return the groups with why joints moved at places that did not.

    The cell is at fault only where the program, its set-up module and the manifest show no cause,
    and most of the places turned: a few are turned by pins, or by hand.
    """
    alone = [group for group in found if group.text.endswith(NOT_HERE)]
    others = [group for group in found if group not in alone]
    if any(g.kind == "cell" and not g.ids[0].endswith(_HOME) for g in others):
        at = [
            replace(g, kind="posture", text=g.text.replace(NOT_HERE, names(g.ids))) for g in alone
        ]
        return [*others, *at]
    turned = sum(len(group.ids) for group in found)
    if any(group.kind != "spin" for group in others) or 2 * turned <= places:
        return list(found)
    count = sum(group.count for group in found)
    text = f"all points as before in tool and base, {count} motions with other joint angles: "
    return [Group("cell", count, (), dict(found[0].worst), text + NOT_HERE), *others]


# ---------------------------------------------------------------------------- frames and the home


def _with_amount(text: str, compared: Sequence[Compared]) -> str:
    """Return the text about a frame with how far it moved, where the program says so."""
    if text in ("tool frame became another frame", "base frame became another frame"):
        name = text[:4]
        for pair in compared:
            for a, b in zip(pair.old_motion.tolist(), pair.new_motion.tolist(), strict=True):
                T = _frame(pair.old.trace, name, a), _frame(pair.new.trace, name, b)
                if np.abs(T[0] - T[1]).max() > 1e-9:
                    return f"{name} {_number(pair, name, a)}{_shift(*T)}"
    numbers = [
        np.array([float(v) for v in re.findall(r"\b[XYZABC] (-?[\d.]+(?:E[-+]?\d+)?)", part)])
        for part in text.split(" became ")
    ]
    if "_DATA[" in text and len(numbers) == 2 and all(len(v) == 6 for v in numbers):
        return f"{text.partition('=')[0]}{_delta(numbers[1] - numbers[0])}"
    return text


def _frame(trace: Trace, name: str, motion: int) -> FloatArray:
    row = getattr(trace.settings[int(trace.setting[motion])], name)
    return np.asarray((trace.tools if name == "tool" else trace.bases)[row])


def _number(pair: Compared, name: str, motion: int) -> str:
    trace = pair.old.trace
    number = getattr(trace.settings[int(trace.setting[motion])], f"{name}_number")
    return str(number) if number >= 0 else "frame"


def _shift(a: FloatArray, b: FloatArray) -> str:
    before, after = (np.hstack(kuka_from_transform(T)) for T in (a, b))
    return _delta(after - before)


def _delta(change: FloatArray) -> str:
    """Return how a frame (6,) [mm, deg] moved."""
    turned = (change[3:] + 180.0) % 360.0 - 180.0
    x, y, z, a, b, c = (tidy(v) for v in (*change[:3], *turned))
    angles = f", A, B, C by ({a:g}, {b:g}, {c:g}) deg" if (a, b, c) != (0.0, 0.0, 0.0) else ""
    return f" moved by ({x:g}, {y:g}, {z:g}) mm{angles}"


def changed_frames(compared: Compared, old: dict[str, Any], new: dict[str, Any]) -> Iterator[Group]:
    """Yield the tools and bases of a program whose frames moved, by what the manifests say."""
    count = len(compared.new_motion)
    for kind, name in (("bases", "base"), ("tools", "tool")):
        numbers = {str(getattr(s, f"{name}_number")) for s in compared.new.trace.settings}
        before, after = old.get(kind, {}), new.get(kind, {})
        for number in sorted(numbers & before.keys() & after.keys()):
            change = np.subtract(after[number], before[number])
            if np.abs(change).max() > 1e-6:
                one = f"{name} {number}"
                text = f"{one}{_delta(change)}: {count} motions with it"
                size = float(np.linalg.norm(change[:3]))
                yield Group("cell", count, (one,), {"id": one, "distance_mm": round(size, 4)}, text)


def home_of(program: Program) -> FloatArray | None:
    """Return the joint target (6,) [rad] where a program begins and ends, None without one."""
    trace = program.trace
    if len(trace) < 2 or not (trace.is_axes[0] and trace.is_axes[-1]):
        return None
    first, last = np.nan_to_num(trace.target[0]), np.nan_to_num(trace.target[-1])
    return first if np.array_equal(first, last) else None


def changed_homes(compared: Compared, angle_deg: float) -> Iterator[Group]:
    """Yield what became of the home."""
    before, after = home_of(compared.old), home_of(compared.new)
    if before is None and after is None:
        return
    if before is not None and after is not None:
        if np.abs(before - after).max() <= angle_deg * DEG:
            return
        text = f"home {_axes(before)} became {_axes(after)}"
    elif after is not None:
        text = f"a home at both ends, {_axes(after)}; there was none"
    else:
        text = "no home at the ends any more"
    yield Group("cell", 2, (_HOME,), {"id": _HOME}, text)


def _axes(q: FloatArray) -> str:
    return "(" + ", ".join(f"{v:g}" for v in np.round(q / DEG, 4).tolist()) + ") deg"
