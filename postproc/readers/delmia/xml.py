"""DELMIA's OLP XML to records: streamed, so that memory does not grow with the file.

External entities, DTDs and the network are off, and a document type declaration is an error: no
OLP file has one, and entities are the way to blow up a reader.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, BinaryIO

from lxml import etree

from postproc.arrays import FloatArray
from postproc.files import open_input
from postproc.readers.delmia.known import strange
from postproc.readers.delmia.records import (
    N_JOINTS,
    NAN,
    Call,
    Document,
    Item,
    Motion,
    MotionProfile,
    RobotData,
    Statement,
    pose,
)
from postproc.readers.text import Faults, check_text, parse_number
from postproc.units import Dimension, unit_named

_MOST_BYTES = 1 << 23
"""No part of a file as long as this is without a finished activity or list."""
_LONG_FILE = 65535
_FIRST_ELEMENT = re.compile(rb"<([A-Za-z_][^\s/>]*)")
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_FARTHEST = 1e6
"""No position lies farther off [m]."""
_WIDEST = 1.0 + 1e-9
"""No fly-by begins farther [m] before its target."""
_ROOT = "OLPData"
_CALL = "DNBIgpCallRobotTask"
_MOTION = "DNBRobotMotionActivity"
_STATEMENTS = {
    "DNBSetSignalActivity": "signal",
    "DNBWaitSignalActivity": "wait",
    "DelayActivity": "delay",
}
_SIGNAL_VALUES = {"on": 1, "true": 1, "1": 1, "off": 0, "false": 0, "0": 0}
_XYZ, _RPY = ("X", "Y", "Z"), ("Roll", "Pitch", "Yaw")
_TAGS = ("GeneralInfo", "ToolProfileList", "MotionProfileList", "AccuracyProfileList",
         "ObjectFrameProfileList", "Activity", "ActivityList", "Resource")  # fmt: skip
_SAFE: dict[str, Any] = {
    "resolve_entities": False, "no_network": True, "load_dtd": False, "huge_tree": False,
    "remove_comments": True, "remove_pis": True,
}  # fmt: skip


class _Checked:
    """A stream that refuses binary data and document type declarations as they pass."""

    def __init__(self, stream: BinaryIO, faults: Faults) -> None:
        self._stream = stream
        self._faults = faults
        self._tail = b""
        self._line = 1
        self.unclaimed = 0
        """Bytes since the last element that was taken."""

    def read(self, size: int = -1) -> bytes:
        """Return the next bytes."""
        chunk = self._stream.read(size)
        check_text(self._faults.path, chunk, self._line)
        if self._line == 1 and not self._tail:
            self._check_root(chunk)
        self.unclaimed += len(chunk)
        if self.unclaimed > _MOST_BYTES:
            text = f"{_MOST_BYTES >> 20} MB without a whole activity, expected OLP XML"
            raise self._faults.error("DEL006", text, self._line)
        seen = self._tail + chunk
        at = seen.find(b"<!DOCTYPE")
        if at >= 0:
            message = "a document type declaration, expected plain OLP XML without DTD or entities"
            raise self._faults.error("DEL002", message, self._line + seen.count(b"\n", 0, at))
        self._line += chunk.count(b"\n")
        self._tail = seen[-8:].replace(b"\n", b" ")
        return chunk

    def _check_root(self, head: bytes) -> None:
        match = _FIRST_ELEMENT.search(_COMMENT.sub(b"", head))
        if match and match.group(1).rpartition(b":")[2] != _ROOT.encode():
            tag = match.group(1)[:40].decode("latin-1")
            raise self._faults.error("DEL003", f"the root element is {tag}, expected {_ROOT}", 1)


def read_document(path: str, faults: Faults) -> Document:
    """Return everything in an OLP file that matters to a path; errors have a ``DEL`` code."""
    document = Document()
    with open_input(path) as stream:
        checked = _Checked(stream, faults)
        events = etree.iterparse(checked, events=("end",), tag=_TAGS, **_SAFE)
        try:
            _walk(events, checked, document, faults)
        except etree.XMLSyntaxError as problem:
            message = str(problem.msg or problem).split("(<string>")[0]
            text = f"not well-formed XML: {message}"
            raise faults.error("DEL001", text, problem.lineno or 1) from None
    root = events.root
    if root is None or root.tag != _ROOT:
        tag = "nothing" if root is None else str(root.tag)[:40]
        raise faults.error("DEL003", f"the root element is {tag}, expected {_ROOT}", 1)
    _note_strange(document, root)
    return document


def _note_strange(document: Document, element: etree._Element) -> None:
    for name, found in strange(element):
        document.strange.setdefault(name, []).append(_line(found))


def _walk(events: etree.iterparse, checked: _Checked, document: Document, faults: Faults) -> None:
    reader = _ElementReader(document, faults)
    for _, element in events:
        reader.take(element)
        checked.unclaimed = 0
        if element.tag != "Activity":
            element.clear()
            continue
        element.clear()
        parent = element.getparent()
        while parent is not None and element.getprevious() is not None:
            if parent[0].tag != "Activity":
                _note_strange(document, parent[0])
            del parent[0]


class _ElementReader:
    """Takes finished elements one after the other."""

    def __init__(self, document: Document, faults: Faults) -> None:
        self._document = document
        self._faults = faults
        self._robot = RobotData()
        self._items: list[Item] = []
        self._has_tasks = False
        self._bases: dict[tuple[str, ...], tuple[float, ...]] = {}

    def take(self, element: etree._Element) -> None:
        """Take one element of ``_TAGS``."""
        handler = {
            "Activity": self._activity,
            "ActivityList": self._task,
            "GeneralInfo": self._general,
            "Resource": self._resource,
        }.get(str(element.tag), self._profiles)
        if element.tag != "Activity" or not self._is_other(element):
            _note_strange(self._document, element)
        handler(element)

    def _profiles(self, element: etree._Element) -> None:
        """Take the profiles of one kind by their names."""
        kind, robot = str(element.tag).removesuffix("List"), self._robot
        known: dict[str, tuple[dict[str, Any], Callable[[etree._Element], Any]]] = {
            "ToolProfile": (robot.tools, _line),
            "MotionProfile": (robot.motions, self._speed),
            "AccuracyProfile": (robot.blends, self._blend),
            "ObjectFrameProfile": (robot.objects, self._object),
        }
        named, read = known[kind]
        named |= {_text(profile.find("Name")): read(profile) for profile in element.iter(kind)}

    def _general(self, element: etree._Element) -> None:
        self._robot.name = _text(element.find("ResourceName"))
        self._robot.coordinates = _text(element.find("DownloadCoordinates"))
        speed = element.find("MaxSpeed")
        if speed is not None and _text(speed):
            self._robot.max_speed = self._positive(_text(speed), speed, Dimension.SPEED)

    def _speed(self, profile: etree._Element) -> MotionProfile:
        """Return the speed of a motion profile; its unit says of what kind it is."""
        basis = self._choice(profile, "MotionBasis", ("percent", "absolute", "time"))
        if basis == "time":
            return MotionProfile(is_timed=True)
        speed = self._child(profile, "Speed")
        value = speed.get("Value", "")
        unit = unit_named(speed.get("Units", ""))
        if unit is None or unit.dimension is not Dimension.SHARE:
            return MotionProfile(speed=self._positive(value, speed, Dimension.SPEED))
        share = self._positive(value, speed, Dimension.SHARE)
        if share > 1.0:
            raise self._wrong("Speed is above 100 %", speed, value)
        return MotionProfile(share=share)

    def _blend(self, profile: etree._Element) -> float:
        """Return the fly-by distance [m] of an accuracy profile, 0 without one, NaN by speed."""
        if self._choice(profile, "FlyByMode", ("on", "off")) == "off":
            return 0.0
        kind = self._choice(profile, "AccuracyType", ("distance", "speed"))
        value = self._child(profile, "AccuracyValue")
        size = self._number(value.get("Value", ""), value)
        size *= self._unit(value, Dimension.LENGTH if kind == "distance" else Dimension.SHARE)
        if not 0.0 <= size < _WIDEST:
            text = f"AccuracyValue is not from 0 to {_WIDEST:g} m or 100 %"
            raise self._wrong(text, value, value.get("Value", ""))
        return size if kind == "distance" or size == 0.0 else NAN

    def _object(self, profile: etree._Element) -> tuple[str, FloatArray]:
        """Return the reference frame and the pose of an object frame profile."""
        frame = self._child(profile, "ObjectFrame")
        xyz = self._three(self._child(frame, "ObjectFramePosition"), Dimension.LENGTH, _XYZ)
        rpy = self._three(self._child(frame, "ObjectFrameOrientation"), Dimension.ANGLE, _RPY)
        return frame.get("ReferenceFrame", "World"), pose(xyz, rpy)

    def _resource(self, element: etree._Element) -> None:
        if self._has_tasks:
            other = self._document.robot
            if other.name or other.objects:
                text = f"tasks of two robots, {other.name!r} and {self._robot.name!r}"
                hint = "export one robot's tasks to a file"
                raise self._faults.error("DEL014", text, _line(element), hint=hint)
            self._document.robot = self._robot
        self._robot, self._has_tasks = RobotData(), False

    def _task(self, element: etree._Element) -> None:
        name = element.get("Task", "")
        if name in self._document.tasks:
            raise self._faults.error("DEL015", f"two tasks of the name {name!r}", _line(element))
        self._document.tasks[name] = self._items
        self._document.task_lines[name] = _line(element)
        self._items, self._has_tasks = [], True

    def _activity(self, element: etree._Element) -> None:
        kind = element.get("ActivityType", "")
        if kind == _CALL:
            self._items.append(Call(_line(element), _text(self._child(element, "CallName"))))
        elif kind == _MOTION or element.find("Target") is not None:
            self._items.append(self._motion(element, self._child(element, "Target")))
        elif element.find("JointTarget") is not None:
            self._items.append(self._motion(element, element))
        elif kind in _STATEMENTS and self._is_told(element, kind):
            self._items.append(self._statement(element, _STATEMENTS[kind]))
        else:
            name = _text(element.find("ActivityName"))
            self._items.append(Statement(_line(element), kind or "Activity", name))

    @staticmethod
    def _is_other(activity: etree._Element) -> bool:
        """Return whether an activity is of a type that is not carried out: refused as a whole."""
        kind = activity.get("ActivityType", "")
        moves = activity.find("Target") is not None or activity.find("JointTarget") is not None
        return not moves and kind not in (_CALL, _MOTION, *_STATEMENTS)

    def _is_told(self, element: etree._Element, kind: str) -> bool:
        """Return whether an activity says what it does; else it is one without a meaning here."""
        wanted = ("EndTime",) if kind == "DelayActivity" else ("SignalName", "SignalValue")
        return all(self._given(element, name) for name in wanted)

    def _statement(self, element: etree._Element, kind: str) -> Statement:
        """Return a signal, a wait or a delay; values stand in attributes or in elements."""
        line = _line(element)
        if kind == "delay":
            start, end = (self._given(element, name) for name in ("StartTime", "EndTime"))
            seconds = self._number(end, element) - self._number(start or "0", element)
            if seconds < 0.0:
                raise self._faults.error("DEL004", "a delay that ends before it begins", line)
            return Statement(line, kind, value=seconds)
        name, value = (self._given(element, key) for key in ("SignalName", "SignalValue"))
        known = _SIGNAL_VALUES.get(value.lower())
        if known is None:
            raise self._faults.error("DEL004", "SignalValue needs On or Off, not", line, value[:20])
        port = self._number(self._given(element, "PortNumber") or "0", element)
        return Statement(line, kind, name, int(port), float(known))

    def _given(self, element: etree._Element, name: str) -> str:
        """Return what an activity says about something, as an attribute or an element, else ""."""
        for node in element.iter():
            if name in node.attrib:
                return str(node.attrib[name]).strip()
            if node.tag == name:
                return _text(node)
        return ""

    def _motion(self, element: etree._Element, target: etree._Element) -> Motion:
        told = {str(child.tag): _text(child) for child in element.iterfind("MotionAttributes/*")}
        base = target.find("BaseWRTWorld")
        xyz = rpy = (NAN, NAN, NAN)
        tag = group = ""
        cartesian = target.find("CartesianTarget")
        if cartesian is not None:
            xyz = self._three(self._child(cartesian, "Position"), Dimension.LENGTH, _XYZ)
            rpy = self._three(self._child(cartesian, "Orientation"), Dimension.ANGLE, _RPY)
            named = cartesian.find("Tag")
            if named is not None:
                tag, group = _text(named), named.get("TagGroup", "")
        return Motion(
            line=_line(element),
            name=tag or element.get("Operation", "") or _text(element.find("ActivityName")),
            group=group,
            kind=told.get("MotionType", ""),
            via=target.get("ViaPoint", "false").lower() == "true",
            motion_profile=told.get("MotionProfile", ""),
            tool_profile=told.get("ToolProfile", ""),
            accuracy_profile=told.get("AccuracyProfile", ""),
            object_profile=told.get("ObjectFrameProfile", ""),
            xyz=xyz,
            rpy=rpy,
            base=self._base(base) if base is not None else (0.0,) * 6,
            joints=self._joints(target.find("JointTarget"), element, cartesian is None),
        )

    def _base(self, element: etree._Element) -> tuple[float, ...]:
        """Return the robot's base in the world; it is the same for most targets."""
        position, turn = self._child(element, "Position"), self._child(element, "Orientation")
        key = (*position.attrib.values(), *turn.attrib.values())
        known = self._bases.get(key)
        if known is None:
            xyz = self._three(position, Dimension.LENGTH, _XYZ)
            known = self._bases[key] = (*xyz, *self._three(turn, Dimension.ANGLE, _RPY))
        return known

    def _joints(
        self, element: etree._Element | None, activity: etree._Element, needed: bool
    ) -> tuple[float, ...]:
        """Return the first six joints [rad] in the order of their DOF numbers."""
        if element is None:
            if needed:
                raise self._missing("CartesianTarget or JointTarget", activity)
            return ()
        found: dict[int, float] = {}
        for joint in element.iter("Joint"):
            number = parse_number(joint.get("DOFNumber", ""))
            if number is None:
                raise self._missing("DOFNumber", joint)
            if number > N_JOINTS:
                self._faults.warn("DEL120", "positions of external axes are left out", _line(joint))
                continue
            value = self._number(_text(self._child(joint, "JointValue")), joint)
            found[int(number)] = value * self._unit(joint, Dimension.ANGLE, Dimension.LENGTH)
        return tuple(found.get(i, NAN) for i in range(1, N_JOINTS + 1))

    def _three(
        self, element: etree._Element, dimension: Dimension, names: tuple[str, str, str]
    ) -> tuple[float, float, float]:
        unit = self._unit(element, dimension)
        a, b, c = (self._number(element.get(name, ""), element) for name in names)
        return a * unit, b * unit, c * unit

    def _number(self, text: str, element: etree._Element) -> float:
        value = parse_number(text)
        if value is None or abs(value) > _FARTHEST:
            raise self._wrong(f"{element.tag} needs a number, not", element, text or "nothing")
        return value

    def _positive(self, text: str, element: etree._Element, dimension: Dimension) -> float:
        value = self._number(text, element) * self._unit(element, dimension)
        if not value > 0.0:
            raise self._wrong(f"{element.tag} is not above zero", element, text)
        return value

    def _choice(self, element: etree._Element, tag: str, known: tuple[str, ...]) -> str:
        """Return what a child says, in lower case: one of the words known."""
        child = self._child(element, tag)
        word = _text(child).lower()
        if word not in known:
            raise self._wrong(f"{tag} is none of {', '.join(known)}", child, word or "nothing")
        return word

    def _unit(self, element: etree._Element, *dimensions: Dimension) -> float:
        name = element.get("Units", "")
        unit = unit_named(name)
        if unit is None or unit.dimension not in dimensions:
            expected = " or ".join(dimensions)
            text = f"{element.tag} has Units {name[:20]!r}, expected one of {expected}"
            raise self._wrong(text, element)
        return unit.factor

    def _child(self, element: etree._Element, tag: str) -> etree._Element:
        child = element.find(tag)
        if child is None:
            raise self._missing(tag, element)
        return child

    def _wrong(self, message: str, element: etree._Element, found: str = "") -> Exception:
        return self._faults.error("DEL004", message, _line(element), found)

    def _missing(self, tag: str, element: etree._Element) -> Exception:
        return self._faults.error("DEL005", f"{element.tag} without {tag}", _line(element))


def _text(element: etree._Element | None) -> str:
    return (element.text or "").strip() if element is not None else ""


def _line(element: etree._Element) -> int:
    """Return the line of the start tag; beyond line 65534 libxml2 keeps only that of its end."""
    line = element.sourceline
    if not isinstance(line, int):
        return 1
    return line - (element.text or "").count("\n") if line >= _LONG_FILE else line
