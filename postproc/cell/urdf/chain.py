"""The chain of six moving joints of a URDF file: names, limits, speeds. Standard library only.

Joint frames are left to ``postproc.kinematics``; this reader finds the joints between the root link
and the flange, and refuses what is not a six-axis arm.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from xml.parsers import expat

import numpy as np

from postproc.arrays import ROUNDING, FloatArray
from postproc.cell.urdf.numbers import check_numbers, origin_of
from postproc.errors import CellError, SourceRef
from postproc.files import read_bytes
from postproc.records import dataclass

_MOVING = ("revolute", "continuous")
MOST_TURNS = 1000
"""More sets of whole turns than these at one pose are a slip of units."""
_AXES = 6


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """A joint of the chain: names, kind, limits [rad], speed [rad/s], effort [N*m].

    What the file does not give is NaN, an effort 0.
    """

    name: str
    kind: str
    parent: str
    child: str
    lower: float
    upper: float
    velocity: float
    effort: float
    element: ET.Element


@dataclass(frozen=True, slots=True)
class UrdfChain:
    """The joints from ``root`` to ``tip`` in order, fixed ones included, and all of the file."""

    path: Path
    root: str
    tip: str
    joints: tuple[UrdfJoint, ...]
    all_joints: tuple[UrdfJoint, ...]
    tree: ET.Element

    @property
    def moving(self) -> tuple[UrdfJoint, ...]:
        """The six joints that move."""
        return tuple(joint for joint in self.joints if joint.kind in _MOVING)


def read_chain(path: Path, tip: str | None = None, source: SourceRef | None = None) -> UrdfChain:
    """Return the chain of six moving joints from the root to the flange.

    ``tip``: name of the flange link; default: the only pose behind six moving joints. ``source``:
    where the cell names the file. CEL011 if this is not the URDF of a six-axis arm, CEL032 if its
    flange may be several links.
    """
    tree = _parse(path)
    joints = [_joint(element, path) for element in tree.findall("joint")]
    links = [str(link.get("name")) for link in tree.findall("link")]
    by_child = {joint.child: joint for joint in joints}
    if len(by_child) != len(joints):
        raise _error(path, "a link hangs on two joints")
    for joint in joints:
        for name in (joint.parent, joint.child):
            if name not in links:
                raise _error(path, f"joint {joint.name!r} names link {name!r}, which is not there")
    tip = tip if tip is not None else _only_tip(path, links, joints, by_child, source)
    if tip not in links:
        known = ", ".join(links[:20])
        raise _error(path, f"no link is named {tip!r}, known are {known}", source)
    chain = _chain_to(tip, by_child)
    for joint in chain:
        if joint.kind not in (*_MOVING, "fixed"):
            raise _error(path, f"joint {joint.name!r} is {joint.kind}, expected revolute", source)
    count = sum(joint.kind in _MOVING for joint in chain)
    if count != 6:
        raise _error(path, f"{count} moving joints lead to link {tip!r}, expected 6", source)
    _require_few_turns(chain, path)
    return UrdfChain(path, chain[0].parent, tip, tuple(chain), tuple(joints), tree)


def _require_few_turns(chain: list[UrdfJoint], path: Path) -> None:
    """Refuse limits within which one pose has far too many sets of whole turns."""
    spans = {joint.name: joint.upper - joint.lower for joint in chain if joint.kind == "revolute"}
    turns = {name: span / math.tau for name, span in spans.items()}
    if math.prod(max(math.ceil(count), 1) for count in turns.values()) > MOST_TURNS:
        name = max(turns, key=lambda name: turns[name])
        text = f"joint {name!r} turns {turns[name]:g} times between its limits"
        raise _error(path, f"{text}, expected limits in rad")


def _parse(path: Path) -> ET.Element:
    raw = read_bytes(path)
    try:
        tree = ET.fromstring(raw)
    except ET.ParseError as problem:
        reason = expat.errors.messages.get(problem.code, "not XML")
        raise CellError(
            "CEL011", f"not valid XML: {reason}", SourceRef(str(path), problem.position[0])
        ) from None
    except (ValueError, LookupError):
        raise _error(path, "not valid XML: unknown encoding") from None
    if b"<xacro:" in raw or path.suffix.lower() == ".xacro":
        text = "a xacro file with macros: postproc new-cell --urdf makes the URDF of it"
        raise _error(path, text)
    if tree.tag != "robot":
        raise _error(path, f"not a URDF file: the root is <{tree.tag}>, expected <robot>")
    check_numbers(raw, path)
    return tree


def _error(path: Path, message: str, source: SourceRef | None = None) -> CellError:
    where = f"{path.name}: " if source else ""
    return CellError("CEL011", f"{where}{message}", source or SourceRef(str(path)))


def _joint(element: ET.Element, path: Path) -> UrdfJoint:
    name = element.get("name") or "?"
    kind = element.get("type") or "?"
    if kind not in (*_MOVING, "fixed", "prismatic", "planar", "floating"):
        raise _error(path, f"joint {name!r} has the unknown type {kind!r}")
    ends = [
        str(child.get("link"))
        for tag in ("parent", "child")
        if (child := element.find(tag)) is not None and child.get("link")
    ]
    if len(ends) != 2:
        raise _error(path, f"joint {name!r} has no parent or no child")
    _require_axis(element, kind, name, path)
    limit = element.find("limit")
    bounds = {key: _number(limit, key) for key in ("lower", "upper", "velocity")}
    if kind == "continuous":
        bounds["lower"] = bounds["upper"] = math.nan
    elif kind == "revolute" and not bounds["lower"] < bounds["upper"]:
        raise _error(path, f"joint {name!r} has no limits with lower below upper")
    if not bounds["velocity"] > 0:
        bounds["velocity"] = math.nan
    effort = float(limit.get("effort", 0.0)) if limit is not None else 0.0
    return UrdfJoint(name, kind, ends[0], ends[1], element=element, effort=effort, **bounds)


def _require_axis(element: ET.Element, kind: str, name: str, path: Path) -> None:
    """Refuse a moving joint whose axis is no direction."""
    axis = element.find("axis")
    text = axis.get("xyz") if axis is not None else None
    if kind == "fixed" or text is None:
        return
    if not math.hypot(*map(float, text.split())) > 1e-6:
        raise _error(path, f"joint {name!r}: axis is {text!r}, expected a direction")


def _number(element: ET.Element | None, key: str) -> float:
    text = element.get(key) if element is not None else None
    if text is None:
        return 0.0 if key != "velocity" and element is not None else math.nan
    return float(text)


def _chain_to(tip: str, by_child: dict[str, UrdfJoint]) -> list[UrdfJoint]:
    chain: list[UrdfJoint] = []
    while tip in by_child and len(chain) <= len(by_child):
        chain.append(by_child[tip])
        tip = by_child[tip].parent
    return chain[::-1]


def _only_tip(
    path: Path,
    links: list[str],
    joints: list[UrdfJoint],
    by_child: dict[str, UrdfJoint],
    source: SourceRef | None,
) -> str:
    """Return the flange, where only one pose behind the sixth moving joint can be meant."""
    counts = {
        link: sum(joint.kind in _MOVING for joint in _chain_to(link, by_child)) for link in links
    }
    sixth = [j.child for j in joints if j.kind in _MOVING and counts[j.child] == _AXES]
    if not sixth:
        parents = {joint.parent for joint in joints}
        ends = {link: count for link, count in counts.items() if link not in parents}
        words = ", ".join(f"{count} to {link!r}" for link, count in ends.items())
        raise _error(path, f"not a six-axis arm: moving joints are {words or 'none'}", source)
    tips = {name: T for link in sixth for name, T in _fixed_to(link, joints, path)}
    names = list(tips) or sixth
    first = tips.get(names[0], np.eye(4))
    same = [T for T in tips.values() if np.abs(T - first).max() < ROUNDING]
    if len(sixth) == 1 and len(same) == len(tips):
        return names[0]
    raise CellError(
        "CEL032",
        f"{'' if source is None else path.name + ': '}the flange may be {', '.join(names[:8])}, "
        "which differ in pose: name it as tip",
        source or SourceRef(str(path)),
        "KUKA's flange, which TOOL_DATA counts from, is tool0 in packages of ROS (z out of it); "
        "their link flange has x out of it",
    )


def _fixed_to(link: str, joints: list[UrdfJoint], path: Path) -> Iterator[tuple[str, FloatArray]]:
    """Yield the links that fixed joints hold to ``link``, with their pose in it."""
    waiting = [(link, np.eye(4))]
    while waiting:
        parent, T_link_parent = waiting.pop(0)
        for joint in joints:
            if joint.kind == "fixed" and joint.parent == parent:
                T = T_link_parent @ origin_of(joint.element)
                yield joint.child, T
                waiting.append((joint.child, T))
