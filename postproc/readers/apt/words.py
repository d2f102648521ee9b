"""What each word of a CL file means, apart from motions, cycles, feeds and frames.

A word that is in no table is kept as an event ``UNKNOWN`` with its text and counted. Two kinds of
words are refused instead, because leaving them out would change the path: those one letter away
from a word that moves the tool, and those of the APT language that compute or transform motions.
"""

from __future__ import annotations

from collections.abc import Callable

from postproc.model import EventKind
from postproc.readers.apt import cycle as apt_cycle
from postproc.readers.apt import feed as apt_feed
from postproc.readers.apt import frames as apt_frames
from postproc.readers.apt import nurbs as apt_nurbs
from postproc.readers.apt.state import AptState
from postproc.readers.apt.statement import Statement, bounded
from postproc.readers.text import shortened

Handler = Callable[[AptState, Statement, int], None]

IGNORED = frozenset(
    {
        "PAINT", "TRNTYP", "MACHIN", "BOX", "CSI_SET_FLUTE_LENGTH", "CSI_SET_EXTENSION_LENGTH",
        "MOVE_ATTRIB", "INTOL", "OUTTOL", "TOLER", "AUTOPS", "PLABEL", "SEQNO", "LEADER", "REWIND",
        "SELECT", "SWITCH", "CHANNEL", "CLPRNT", "NOPOST", "MULTAX", "RESERV", "MODE", "CUT",
        "DNTCUT", "OPFEATEND", "ISTOP",
    }
)  # fmt: skip
"""Known words without a meaning for a robot's path. MULTAX: the axis rule needs no mode."""
_REFUSED = frozenset(
    {
        "COPY", "INDEX", "TRACUT", "MACRO", "CALL", "LOOPST", "JUMPTO", "IF", "GOFWD", "GOLFT",
        "GORGT", "GOBACK", "GOUP", "GODOWN", "GO", "TRANS", "MATRIX", "REFSYS", "POCKET", "SCURV",
        "ROTHED", "THREAD", "TLLFT", "TLRGT", "OFFSET", "SURF",
    }
)  # fmt: skip
"""Words that compute or move motions; this reader takes the computed result, CL data."""
_MOVING = (
    "GOTO", "CIRCLE", "RAPID", "FEDRAT", "CYCLE", "GODLTA", "MSYS", "TLAXIS", "ORIGIN", "UNITS",
    "UNIT", "NURBS", "CNTRL", "KNOT", "ROTABL", "INDIRV", "CSYS", "FROM", "END-OF-PATH", "FINI",
    "CYCLE81", "CYCLE82", "CYCLE83", "SPINDL", "COOLNT", "LOADTL", "TOOLNO", "DELAY", "OPSTOP",
)  # fmt: skip
"""Words that must not get lost by a slip of one letter."""
_NEAR_LENGTH = 4


def handle(state: AptState, statement: Statement, line: int) -> None:
    """Let one statement that is no motion take effect."""
    word = statement.word
    if state.spline is not None and word not in ("KNOT", "CNTRL"):
        apt_nurbs.close_spline(state)
    if state.table.is_moving and word != "ROTABL":
        state.table.check(state.faults)
    if state.matrix.is_open:
        state.matrix.check_closed(state.faults)
    handler = _HANDLERS.get(word)
    if handler is not None:
        handler(state, statement, line)
    elif word not in IGNORED:
        _unknown(state, statement, line)


def comment(state: AptState, text: str, line: int) -> None:
    """Take the data that two systems hide in comments; other comments mean nothing."""
    body = text[2:].strip()
    if body.upper().startswith("*CATIA"):
        state.matrix.begin(line)
    elif state.matrix.is_open:
        frame = state.matrix.row(body, state.faults)
        if frame is not None:
            state.set_frame(frame[0], frame[1] * state.scale)
    elif body.startswith("->"):
        _creo_comment(state, body[2:], line)


def _creo_comment(state: AptState, body: str, line: int) -> None:
    head, _, rest = body.partition("/")
    word = head.strip().upper()
    args = tuple(part.strip() for part in rest.split(",") if part.strip())
    statement = Statement(word, args, body.strip())
    if word == "CUTTER":
        _cutter(state, statement, line)
    elif word == "CSYS":
        apt_frames.csys_statement(state, statement, line)
    elif word == "FEATNO" and args:
        state.add_operation(f"FEATNO {args[0]}", line)


def _unknown(state: AptState, statement: Statement, line: int) -> None:
    word = statement.word
    if not word or word[0] in "+-.0123456789":
        raise state.faults.error(
            "APT003", "numbers without a word; is a $ missing on the line before?", line,
            statement.text,
        )  # fmt: skip
    first = word.split(" ")[0].split(",")[0]
    if first in _REFUSED or word in _REFUSED:
        raise state.faults.error(
            "APT007", f"{first} computes motions, expected CL data, its result", line,
            statement.text, "write a CL file from the CAM system instead of APT source",
        )  # fmt: skip
    near = next((known for known in _MOVING if _is_near(first, known)), None)
    if near is not None:
        raise state.faults.error(
            "APT005", f"{word[:30]!r} is no word; is it {near}?", line, statement.text
        )
    _keep_unknown(state, statement, line)


def _keep_unknown(state: AptState, statement: Statement, line: int) -> None:
    shown = shortened(statement.word)
    state.unknown[shown] = state.unknown.get(shown, 0) + 1
    state.add_event(EventKind.UNKNOWN, line, 0.0, statement.text)


def _is_near(word: str, known: str) -> bool:
    """Return whether ``word`` is ``known`` with one letter changed, missing, doubled or swapped."""
    if len(known) < _NEAR_LENGTH or abs(len(word) - len(known)) > 1:
        return False
    same = 0
    while same < min(len(word), len(known)) and word[same] == known[same]:
        same += 1
    rest, other = word[same:], known[same:]
    if len(word) == len(known):
        return rest[1:] == other[1:] or (rest[:2] == other[1::-1] and rest[2:] == other[2:])
    return rest[1:] == other if len(word) > len(known) else rest == other[1:]


def _units(state: AptState, statement: Statement, line: int) -> None:
    name = unit_name(statement.upper[0] if statement.args else "")
    if name is None:
        raise state.faults.error("APT012", "unknown unit of length", line, statement.text)
    if name != state.units:
        raise state.faults.error(
            "APT013", f"the file is read in {state.units}, but here it says {name}", line,
            statement.text,
        )  # fmt: skip


def unit_name(word: str) -> str | None:
    """Return ``mm``, ``inch`` or ``m`` for a minor word of UNITS, None if unknown."""
    return {
        "MM": "mm", "MILLIMETER": "mm", "MILLIMETRE": "mm", "MILLIMETERS": "mm", "METRIC": "mm",
        "INCH": "inch", "INCHES": "inch", "IN": "inch", "ENGLISH": "inch", "M": "m", "METER": "m",
        "METERS": "m", "METRE": "m",
    }.get(word)  # fmt: skip


def _table(state: AptState, statement: Statement, line: int) -> None:
    """ROTABL, ROTATE: a machine's table turns; only CAMWorks writes points in its plane."""
    if state.dialect.setup_plane and statement.word == "ROTABL":
        apt_frames.table_statement(state, statement, line)
        return
    state.faults.warn(
        "APT161", f"{statement.word} turns a table that the robot does not have: left out", line
    )
    _keep_unknown(state, statement, line)


def _cycle_call(state: AptState, statement: Statement, line: int) -> None:
    """MCALL alone ends a Siemens cycle that was called with MCALL."""
    state.cycle.set(state.at, -1)


def _load(state: AptState, statement: Statement, line: int) -> None:
    """LOAD/TOOL,n[,...], LOADTL/n[,...], TOOLNO/n[,...]: a tool change."""
    if statement.word == "LOAD" and "TOOL" not in statement.upper:
        _unknown(state, statement, line)
        return
    words = [word for word in statement.upper if word != "TOOL"]
    number = bounded(words[0]) if words else None
    if number is None or number < 0 or number != int(number):
        raise state.faults.error(
            "APT070", "a tool change without a tool number", line, statement.text
        )
    if state.tools.number != int(number) or not state.tools.loaded:
        state.add_event(EventKind.TOOL_CHANGE, line, float(number), statement.text)
    state.tools.number, state.tools.loaded = int(number), True
    data: dict[str, float] = {}
    if statement.word == "TOOLNO":
        diameter = bounded(statement.args[1]) if len(statement.args) > 1 else None
        data = {"diameter": diameter * state.scale} if diameter else {}
    state.add_tool(line, number=int(number), **data)


def _cutter(state: AptState, statement: Statement, line: int) -> None:
    """CUTTER/d,r,e,f,a,b,h."""
    numbers = statement.numbers()
    if not numbers or numbers[0] is None or numbers[0] < 0.0:
        raise state.faults.error("APT071", "CUTTER without a diameter", line, statement.text)
    _describe(state, line, [v for v in numbers if v is not None], height=6)


def _tool_data(state: AptState, statement: Statement, line: int) -> None:
    """TLDATA/MILL,d,r,length,taper,tip (NX); of other kinds only the diameter is sure."""
    numbers = [value for value in statement.numbers() if value is not None]
    if not numbers or numbers[0] < 0.0:
        raise state.faults.error("APT071", "TLDATA without a diameter", line, statement.text)
    is_mill = statement.upper[0] == "MILL"
    _describe(state, line, numbers if is_mill else numbers[:1], height=2)


def _describe(state: AptState, line: int, numbers: list[float], height: int) -> None:
    data = {"diameter": numbers[0] * state.scale}
    if len(numbers) > 1:
        data["corner_radius"] = numbers[1] * state.scale
    if len(numbers) > height:
        data["length"] = numbers[height] * state.scale
    state.add_tool(line, **data)


def _tool_path(state: AptState, statement: Statement, line: int) -> None:
    """TOOL PATH/name,TOOL,tool name (NX): a new operation; the tool axis begins at (0, 0, 1)."""
    args = statement.args
    state.last_open = line
    state.add_operation(args[0] if args else "", line)
    if len(args) > 2 and args[1].upper() == "TOOL":
        state.add_tool(line, name=args[2])
    if statement.word in state.dialect.axis_reset:
        state.set_axis(0.0, 0.0, 1.0)


def _insert(state: AptState, statement: Statement, line: int) -> None:
    """INSERT/text (SolidWorks CAM): STOP, the stock's size, else the name of the coming tool."""
    text = statement.free_text
    if text.upper().startswith("STOP"):
        state.add_event(EventKind.STOP, line, 0.0, text)
    elif text.upper().startswith("STOCK SIZE"):
        state.add_event(EventKind.MESSAGE, line, 0.0, text)
    else:
        state.add_tool(line, name=text)


def _message(state: AptState, statement: Statement, line: int) -> None:
    if statement.free_text:
        state.add_event(EventKind.MESSAGE, line, 0.0, statement.free_text)


def _coolant(state: AptState, statement: Statement, line: int) -> None:
    off = "OFF" in statement.upper
    kind = EventKind.COOLANT_OFF if off else EventKind.COOLANT_ON
    state.add_event(kind, line, 0.0, ",".join(statement.upper))


def _dwell(state: AptState, statement: Statement, line: int) -> None:
    """DELAY/seconds; DELAY/n,REV in turns of the spindle."""
    numbers = [value for value in statement.numbers() if value is not None]
    if not numbers or numbers[0] < 0.0:
        raise state.faults.error("APT072", "DELAY without a time", line, statement.text)
    seconds = numbers[0]
    if "REV" in statement.upper:
        if not state.spindle > 0.0:
            raise state.faults.error("APT072", "DELAY in turns without a spindle speed", line)
        seconds /= state.spindle
    state.add_event(EventKind.DWELL, line, seconds)


def _stop(state: AptState, statement: Statement, line: int) -> None:
    state.add_event(EventKind.STOP, line, 0.0, statement.free_text)


def _optional_stop(state: AptState, statement: Statement, line: int) -> None:
    state.add_event(EventKind.OPTIONAL_STOP, line, 0.0, statement.free_text)


def _compensation(state: AptState, statement: Statement, line: int) -> None:
    """CUTCOM: a controller would shift the path by the tool radius; a robot does not."""
    if not {"OFF", "ON"} & set(statement.upper[:1]):
        state.faults.warn(
            "APT120",
            "CUTCOM: a robot has no cutter compensation, the path is driven as it stands",
            line,
        )


def _from(state: AptState, statement: Statement, line: int) -> None:
    """FROM/x,y,z[,i,j,k]: where the tool stands; no motion."""
    numbers = [value for value in statement.numbers() if value is not None]
    if len(numbers) != len(statement.args) or len(numbers) not in (3, 6):
        raise state.faults.error("APT073", "FROM needs 3 or 6 numbers", line, statement.text)
    R, t = state.frames[int(state.frame.value)]
    if state.tag == 0:
        state.start = R @ numbers[:3] * state.scale + t
    if len(numbers) > 3:
        state.set_axis(*apt_frames.unit_axis(state, numbers[3:], line))
    state.last_point = None


def _go_home(state: AptState, statement: Statement, line: int) -> None:
    """GOHOME: the machine tool's home means nothing to the robot."""
    state.faults.warn(
        "APT121",
        "GOHOME is the machine tool's home and is not driven; the robot has its own",
        line,
    )


def _operation(state: AptState, statement: Statement, line: int) -> None:
    """OPFEATSTART/name (CAMWorks): a new operation on the untilted table."""
    apt_frames.untilt(state)
    state.add_operation(statement.text.partition("/")[2].strip(), line)


def _setup(state: AptState, statement: Statement, line: int) -> None:
    if statement.upper[:1] == ("START",):
        state.add_operation(" ".join(("SETUP", *statement.args[1:])), line)


def _end(state: AptState, statement: Statement, line: int) -> None:
    if statement.word in state.dialect.ends:
        state.last_end = line


_HANDLERS: dict[str, Handler] = {
    "FEDRAT": apt_feed.feed_statement,
    "CYCLE": apt_cycle.cycle_statement,
    "CYCLE81": apt_cycle.siemens_statement,
    "CYCLE82": apt_cycle.siemens_statement,
    "CYCLE83": apt_cycle.siemens_statement,
    "MCALL": _cycle_call,
    "SPINDL": apt_feed.spindle_statement,
    "COOLNT": _coolant,
    "UNITS": _units,
    "UNIT": _units,
    "LOAD": _load,
    "LOADTL": _load,
    "TOOLNO": _load,
    "CUTTER": _cutter,
    "TLDATA": _tool_data,
    "TOOL PATH": _tool_path,
    "INSERT": _insert,
    "PARTNO": _message,
    "PPRINT": _message,
    "TPRINT": _message,
    "DELAY": _dwell,
    "STOP": _stop,
    "OPSTOP": _optional_stop,
    "CUTCOM": _compensation,
    "FROM": _from,
    "GOHOME": _go_home,
    "MSYS": apt_frames.msys_statement,
    "CSYS": apt_frames.csys_statement,
    "ORIGIN": apt_frames.origin_statement,
    "TLAXIS": apt_frames.tool_axis_statement,
    "ROTABL": _table,
    "ROTATE": _table,
    "OPFEATSTART": _operation,
    "SETUP": _setup,
    "NURBS": apt_nurbs.open_spline,
    "KNOT": apt_nurbs.knot_statement,
    "CNTRL": apt_nurbs.control_statement,
    "FINI": _end,
    "END": _end,
    "END-OF-PATH": _end,
}
