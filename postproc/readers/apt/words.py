"""What each word of a CL file means, apart from motions, cycles, feeds and frames.

``word_classes`` has the table of all words; a word without a handler here is refused, noted or
kept as it says, one in no table is refused (``refused``).
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from postproc.model import CamSetup, EventKind, WordClass
from postproc.process import COOLANTS
from postproc.readers.apt import cycle as apt_cycle
from postproc.readers.apt import feed as apt_feed
from postproc.readers.apt import frames as apt_frames
from postproc.readers.apt import nurbs as apt_nurbs
from postproc.readers.apt.refused import refuse, unhandled
from postproc.readers.apt.state import AptState, EventRecord
from postproc.readers.apt.statement import FREE_TEXT, Statement, bounded
from postproc.readers.base import LENGTH_UNITS
from postproc.readers.text import shortened
from postproc.units import Dimension, unit_named

Handler = Callable[[AptState, Statement], None]
_NX_CENTRE = "CENTERLINE DATA"
"""Comment of NX: the points of this path are those of the tool centre."""
_LATHE = "turning, which a robot with a spindle cannot do"
_MODES = {
    "INCR": "points as increments, at least for the control",
    "LATHE": _LATHE,
    "TURN": _LATHE,
    "TOOL": "another tool axis than that of the points",
    "AXIS": "another tool axis than that of the points",
}
_TOOL_NAMES = ("solidworks", "camworks")
"""Seats that write the name of the coming tool as INSERT."""
_NO_NAMES = re.compile(r"ADJUST|LENGTH|OSETNO|OFFSET|IN|OUT|AUTO|MANUAL|NEXTTL|SPINDL")
"""Minor words of a tool change, which are no names of tools."""
_QUOTED = re.compile(r"'([^']*)'")
_CODE = re.compile(r"[/'\"\s]*(?:N\s*\d+\s*)?[GMTSF#]\s*\d", re.IGNORECASE)
"""Code of a control, perhaps behind its skip sign and block number: it can do anything."""
_ASKS_FOR_MORE = re.compile(r"(?<!\$)\$\s*$")
_STOPS = {"STOP": EventKind.STOP, "OPSTOP": EventKind.OPTIONAL_STOP}
_STOP = re.compile(r"STOP\b", re.IGNORECASE)


def handle(state: AptState, statement: Statement) -> None:
    """Let one statement that is no motion take effect."""
    word = statement.word
    if state.spline is not None and word not in ("KNOT", "CNTRL"):
        apt_nurbs.close_spline(state)
    if state.table.is_moving and word != "ROTABL":
        state.table.check(state.faults)
    if state.matrix.is_open:
        state.matrix.check_closed(state.faults)
    if word in FREE_TEXT and _ASKS_FOR_MORE.search(statement.text):
        reason = "ends in $, and nothing says whether the next line is more of the text; it is not"
        state.refuse(word, WordClass.COMMENT, reason)
    _HANDLERS.get(word, unhandled)(state, statement)


def comment(state: AptState, statement: Statement) -> None:
    """Take the data that two systems hide in comments; other comments mean nothing."""
    body = statement.text[2:].strip()
    if body.upper().startswith("*CATIA"):
        state.matrix.begin(state.line)
    elif state.matrix.is_open:
        frame = state.matrix.row(body, state.faults)
        if frame is not None:
            R, origin = frame[0], frame[1] * state.scale
            state.set_frame(R, origin)
            name = state.matrix.name.lstrip("*").strip()
            state.setups.place("CATIA", state.line, R, origin, carried=True, name=name)
    elif body.startswith("->"):
        _creo_comment(state, body[2:])
    elif body.upper() == _NX_CENTRE:
        state.centre_points = True


def _creo_comment(state: AptState, body: str) -> None:
    head, _, rest = body.partition("/")
    word = head.strip().upper()
    args = tuple(part.strip() for part in rest.split(",") if part.strip())
    state.text = body.strip()
    statement = Statement(word, args, state.text)
    if word == "CUTTER":
        _cutter(state, statement)
    elif word == "CSYS":
        apt_frames.csys_statement(state, statement)
    elif word == "FEATNO" and args:
        state.add_operation(f"FEATNO {args[0]}")
    elif word == "CUTCOM_GEOMETRY_TYPE":
        state.centre_points = statement.upper == ("OUTPUT_ON_CENTER",)


def _units(state: AptState, statement: Statement) -> None:
    name = unit_name(statement.upper[0] if statement.args else "")
    if name is None:
        raise state.error("APT012", "unknown unit of length")
    if name != state.units:
        raise state.error("APT013", f"the file is read in {state.units}, but here it says {name}")


def unit_name(word: str) -> str | None:
    """Return ``mm``, ``inch`` or ``m`` for a minor word of UNITS, None if unknown."""
    unit = unit_named({"METRIC": "mm", "ENGLISH": "inch"}.get(word, word))
    known = unit is not None and unit.dimension is Dimension.LENGTH
    factor = unit.factor if unit is not None and known else None
    return next((name for name, size in LENGTH_UNITS.items() if size == factor), None)


def _mode(state: AptState, statement: Statement) -> None:
    """MODE/MILL says what the file is for; other modes change points, axes or the process."""
    mode = statement.upper[0] if statement.upper else ""
    if mode == "MILL":
        state.note("MODE/MILL", WordClass.PROCESS, "the process is milling")
        return
    lathe = mode in ("LATHE", "TURN")
    reason = _MODES.get(mode, "a mode in no table")
    kind = WordClass.PROCESS if lathe else WordClass.COORDINATES
    refuse(state, statement, kind, reason, mode)


def _load(state: AptState, statement: Statement) -> None:
    """LOAD/TOOL,n[,...], LOADTL/n[,...], TOOLNO/n[,...]: a tool change, n a number or a name."""
    first = statement.upper[0] if statement.upper else ""
    if statement.word == "LOAD" and "TOOL" not in statement.upper:
        reason = "loads something else than a tool, for which there is no hook"
        refuse(state, statement, WordClass.TOOL, reason, first)
        return
    if statement.word == "TOOLNO" and first == "ADJUST":
        reason = "number of a length offset of the control; the points are those of the tip"
        state.note("TOOLNO/ADJUST", WordClass.TOOL, reason)
        return
    said = _tool_called(state, statement)
    words = statement.upper
    _check_length(state, words, next(iter(said.values())))
    if statement.word == "TOOLNO":
        diameter = bounded(statement.args[1]) if len(statement.args) > 1 else None
        said |= {"diameter": diameter * state.scale} if diameter else {}
    state.add_tool(statement, said, loads=True)
    if "SPINDL" in words:
        rest = tuple(words[words.index("SPINDL") + 1 :])
        apt_feed.spindle_statement(state, Statement("SPINDL", rest, statement.text))


def _tool_called(state: AptState, statement: Statement) -> dict[str, float | str]:
    """Return the number or the name by which a statement loads a tool."""
    args = [arg for arg in statement.args if arg.upper() != "TOOL"]
    number = bounded(args[0]) if args else None
    if number is not None and number >= 0 and number == int(number):
        return {"number": int(number)}
    quoted = _QUOTED.search(statement.text) if args and args[0].startswith("'") else None
    name = quoted[1].strip() if quoted else args[0] if args else ""
    is_name = quoted is not None or not _NO_NAMES.fullmatch(name.upper())
    if number is not None or statement.word not in ("LOAD", "LOADTL") or not (name and is_name):
        raise state.error("APT070", "a tool change without a tool number or name")
    return {"name": name}


def settle_tools(state: AptState) -> None:
    """Find the tool of every call once the whole file is known, and add the changes."""
    for call, reason in state.tools.settle(state.place):
        state.uses.refuse(call.statement.word, WordClass.TOOL, call.at, reason)
    for place, event in reversed([*state.tools.changes()]):
        state.events.insert(place.event, EventRecord(event, place.spline))


def _check_length(state: AptState, words: tuple[str, ...], tool: float | str) -> None:
    """Ask a tool back that comes with another LENGTH than before: it is another one."""
    at = words.index("LENGTH") + 1 if "LENGTH" in words else len(words)
    length = bounded(words[at]) if at < len(words) else None
    if length is None:
        return
    before, where = state.tools.lengths.setdefault(tool, (length, state.line))
    if before != length:
        reason = (
            f"tool {tool} comes with LENGTH {length:g}, in line {where} with {before:g}: a cell "
            "has one frame for it"
        )
        state.refuse("LOADTL/LENGTH", WordClass.TOOL, reason)


def _cutter(state: AptState, statement: Statement) -> None:
    """CUTTER/d,r,e,f,a,b,h."""
    numbers = statement.numbers()
    if not numbers or numbers[0] is None or numbers[0] < 0.0:
        raise state.error("APT071", "CUTTER without a diameter")
    _describe(state, statement, [v for v in numbers if v is not None], height=6)


def _tool_data(state: AptState, statement: Statement) -> None:
    """TLDATA/MILL,d,r,length,taper,tip (NX); of other kinds only the diameter is sure."""
    numbers = [value for value in statement.numbers() if value is not None]
    if not numbers or numbers[0] < 0.0:
        raise state.error("APT071", "TLDATA without a diameter")
    is_mill = statement.upper[0] == "MILL"
    _describe(state, statement, numbers if is_mill else numbers[:1], height=2)


def _describe(state: AptState, statement: Statement, numbers: list[float], height: int) -> None:
    data = {"diameter": numbers[0] * state.scale}
    if len(numbers) > 1:
        data["corner_radius"] = numbers[1] * state.scale
    if len(numbers) > height:
        data["length"] = numbers[height] * state.scale
    state.add_tool(statement, data)


def _tool_path(state: AptState, statement: Statement) -> None:
    """TOOL PATH/name,TOOL,tool name (NX): a new operation; the tool axis begins at (0, 0, 1)."""
    args = statement.args
    state.last_open = state.line
    state.centre_points = False
    state.add_operation(args[0] if args else "")
    if len(args) > 2 and args[1].upper() == "TOOL":
        state.add_tool(statement, {"name": args[2]})
    if statement.word in state.dialect.axis_reset:
        state.set_axis(0.0, 0.0, 1.0)


def _insert(state: AptState, statement: Statement) -> None:
    """INSERT/text (SolidWorks CAM): STOP, the stock's size, else the name of the coming tool."""
    text = statement.free_text
    if _STOP.match(text):
        state.add_event(EventKind.STOP, 0.0, text)
    elif text.upper().startswith("STOCK SIZE"):
        state.add_event(EventKind.MESSAGE, 0.0, text)
    elif _CODE.match(text):
        reason = f"{shortened(text)!r} is code for the control, which is not sent"
        state.refuse("INSERT", WordClass.PROCESS, reason)
        state.add_event(EventKind.MESSAGE, 0.0, text)
    elif text.startswith((";", "#")):
        reason = "text for the control that looks like code; it is not sent"
        state.note("INSERT", WordClass.PROCESS, reason)
        state.add_event(EventKind.MESSAGE, 0.0, text)
    elif state.dialect.name in _TOOL_NAMES:
        state.add_tool(statement, {"name": text})
    elif text:
        state.add_event(EventKind.MESSAGE, 0.0, text)


def _text(state: AptState, statement: Statement) -> None:
    """A text to the operator, with a stop or without."""
    kind = _STOPS.get(statement.word, EventKind.MESSAGE)
    if statement.free_text or statement.word in _STOPS:
        state.add_event(kind, 0.0, statement.free_text)


def _coolant(state: AptState, statement: Statement) -> None:
    off = "OFF" in statement.upper
    for word in statement.upper:
        if word and word != "OFF" and word not in COOLANTS:
            reason = "a kind of coolant that has no number for the routine; flood is called"
            state.refuse(f"COOLNT/{word[:20]}", WordClass.PROCESS, reason)
    kind = EventKind.COOLANT_OFF if off else EventKind.COOLANT_ON
    state.add_event(kind, 0.0, ",".join(statement.upper))


def _compensation(state: AptState, statement: Statement) -> None:
    """CUTCOM: a control would shift the path by the tool radius; a robot has to be told no."""
    words = statement.upper
    if words[:1] == ("OFF",):
        return
    if "ADJUST" in words:
        reason = (
            "the number of a work offset of the control: coordinates that the file does not give"
        )
        refuse(state, statement, WordClass.COORDINATES, reason, "ADJUST")
        numbers = statement.numbers()
        if words[0] == "ADJUST" and len(numbers) == 2 and numbers[1] is not None:
            name = f"{numbers[1]:g}"
            state.setups.call(CamSetup(name, state.line, aliases=(f"ADJUST_{name}",)))
    elif "LENGTH" in words:
        reason = "a length offset of the control, which nothing says is in the points already"
        refuse(state, statement, WordClass.TOOL, reason, "LENGTH")
    elif state.centre_points:
        reason = (
            "the file says that its points are the tool centre: the path is driven as it stands"
        )
        state.note("CUTCOM", WordClass.TOOL, reason)
    else:
        reason = (
            "a control would shift the path by the tool radius, a robot does not, and nothing says "
            "that the points are the tool centre already"
        )
        state.refuse("CUTCOM", WordClass.TOOL, reason)


def _from(state: AptState, statement: Statement) -> None:
    """FROM/x,y,z[,i,j,k]: where the tool stands; no motion."""
    numbers = [value for value in statement.numbers() if value is not None]
    if len(numbers) != len(statement.args) or len(numbers) not in (3, 6):
        raise state.error("APT073", "FROM needs 3 or 6 numbers")
    R, t = state.frames[int(state.frame.value)]
    if state.tag:
        reason = "where the tool is said to stand; the path goes on from the point before"
        state.note("FROM", WordClass.GEOMETRY, reason)
    else:
        state.start = R @ numbers[:3] * state.scale + t
    if len(numbers) > 3:
        (axis,) = state.unit_axes(np.array([numbers[3:]]), np.array([state.line]))
        state.set_axis(*axis.tolist())
    state.last_point = None


def _go_home(state: AptState, statement: Statement) -> None:
    """GOHOME: the machine tool's home means nothing to the robot, which goes to its own."""
    numbers = statement.numbers()
    if None in numbers and any(statement.args):
        what = "a reference move of the target control"
        refuse(state, statement, WordClass.GEOMETRY, what, statement.upper[0])
        return
    state.homes.append((state.tag, state.line))
    text = "GOHOME is the machine tool's home and is not driven; the robot has its own"
    state.warn("APT121", text)


def check_homes(state: AptState) -> None:
    """Refuse homes between two motions: only at an end the robot goes to its own."""
    for tag, line in state.homes:
        if 0 < tag < state.done:
            text = "a home between two motions is not driven"
            state.uses.refuse("GOHOME", WordClass.GEOMETRY, line, text)


def _named_operation(state: AptState, statement: Statement) -> None:
    """OPNAME/'name' (MfgSuite): a new operation."""
    state.add_operation(statement.free_text.strip("'"))


def _operation(state: AptState, statement: Statement) -> None:
    """OPFEATSTART/name (CAMWorks): a new operation on the untilted table."""
    apt_frames.untilt(state)
    state.add_operation(statement.text.partition("/")[2].strip())


def _setup(state: AptState, statement: Statement) -> None:
    if statement.upper[:1] == ("START",):
        state.add_operation(" ".join(("SETUP", *statement.args[1:])))


def _end(state: AptState, statement: Statement) -> None:
    if statement.word in state.dialect.ends:
        state.last_end = state.line
    if statement.word == "FINI":
        state.first_fini = state.first_fini or state.line


_WORDS: dict[Handler, tuple[str, ...]] = {
    apt_feed.feed_statement: ("FEDRAT",),
    apt_cycle.cycle_statement: ("CYCLE",),
    apt_cycle.siemens_statement: ("CYCLE81", "CYCLE82", "CYCLE83"),
    apt_cycle.call_statement: ("MCALL",),
    apt_feed.spindle_statement: ("SPINDL",),
    _coolant: ("COOLNT",),
    _units: ("UNITS", "UNIT"),
    _load: ("LOAD", "LOADTL", "TOOLNO", "TOOL", "TURRET"),
    _cutter: ("CUTTER",),
    _tool_data: ("TLDATA",),
    _tool_path: ("TOOL PATH",),
    _insert: ("INSERT",),
    _text: ("PARTNO", "PPRINT", "TPRINT", "STOP", "OPSTOP"),
    apt_feed.dwell_statement: ("DELAY",),
    _compensation: ("CUTCOM",),
    _from: ("FROM",),
    _go_home: ("GOHOME",),
    _named_operation: ("OPNAME",),
    apt_frames.msys_statement: ("MSYS",),
    apt_frames.csys_statement: ("CSYS",),
    apt_frames.origin_statement: ("ORIGIN",),
    apt_frames.mcsys_statement: ("MCSYS",),
    apt_frames.mcs_statement: ("MCS", "MCS2"),
    apt_frames.zero_statement: ("ZERO",),
    apt_frames.tool_axis_statement: ("TLAXIS",),
    apt_frames.table_statement: ("ROTABL", "ROTATE"),
    _mode: ("MODE",),
    apt_frames.translate_statement: ("TRANS",),
    apt_frames.multax_statement: ("MULTAX",),
    _operation: ("OPFEATSTART",),
    _setup: ("SETUP",),
    apt_nurbs.open_spline: ("NURBS",),
    apt_nurbs.knot_statement: ("KNOT",),
    apt_nurbs.control_statement: ("CNTRL",),
    _end: ("FINI", "END", "END-OF-PATH"),
}
_HANDLERS = {word: handler for handler, words in _WORDS.items() for word in words}
