"""The error tree, findings (``Finding``) and exit codes.

An error carries its values as attributes, so that the command line prints
``FILE:LINE: error CODE: message`` and a caller can read the parts.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from enum import IntEnum, StrEnum

from postproc.records import dataclass

LISTED = 12
"""Lines or tags that a message names at most."""


def listed(names: Sequence[object], most: int = LISTED) -> str:
    """Return names with commas between, at most so many, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(str, names[:most])) + more


class ExitCode(IntEnum):
    """Exit codes of every command."""

    GOOD = 0
    BAD_ANSWER = 1
    BAD_INPUT = 2
    INTERNAL = 70
    INTERRUPTED = 130


class Severity(StrEnum):
    """How much a finding matters: an error forbids a program."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


class RunKind(StrEnum):
    """Codes of what is found when a program is run: ``kind`` in ``verify --json``.

    The first block is told by the controller, the second by joint paths, the third by what a cell
    allows, the last by a CAM file.
    """

    STRUCTURE = "structure"
    ENDLESS = "endless"
    FRAME = "frame"
    TARGET = "target"
    TYPE = "type"
    UNJUDGED = "unjudged"
    CONDITION = "condition"
    WAIT = "wait"

    START = "start"
    TURN = "turn"
    UNREACHABLE = "unreachable"
    CIRCLE = "circle"
    HALF_TURN = "half_turn"
    EXTERNAL = "external"

    SETUP = "setup"
    LOAD = "load"
    ORIENTATION = "orientation"
    JOINT_LIMIT = "joint_limit"
    SINGULARITY = "singularity"
    STRETCHED = "stretched"
    OVERHEAD = "overhead"
    SPEED = "speed"
    AXIS_SPEED = "axis_speed"
    TORQUE = "torque"
    BLEND_END = "blend_end"
    BLEND_LOST = "blend_lost"
    BLEND_CUT = "blend_cut"
    BLOCK_RATE = "block_rate"
    LOOK_AHEAD = "look_ahead"
    MEMORY = "memory"
    CORNER = "corner"
    COLLISION = "collision"

    POSITION = "position"
    MISSED = "missed"
    ORDER = "order"
    DEPTH = "depth"
    AXIS = "axis"
    PATH = "path"
    APPROXIMATION = "approximation"
    FEED = "feed"
    PLUNGE = "plunge"
    BLENDED_PLUNGE = "blended_plunge"
    PECK = "peck"
    RETRACT = "retract"
    DWELL = "dwell"
    EVENT = "event"
    SPINDLE = "spindle"
    ADVANCE = "advance"
    ENTRY = "entry"
    TOOL = "tool"
    WORD = "word"
    MODEL = "model"


@dataclass(frozen=True, slots=True)
class SourceRef:
    """A place in an input file: path as given by the user, 1-based line, and the text there."""

    path: str
    line: int = 1
    text: str = ""

    def __str__(self) -> str:
        """Return ``path:line``, which editors can jump to."""
        return f"{self.path}:{self.line}"


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding: stable code or ``RunKind``, message, the tag and the source line it is about.

    ``headline``: it stands first among those of its severity, and in the first line of an answer.
    """

    severity: Severity
    code: str
    message: str
    tag_index: int | None = None
    source: SourceRef | None = None
    count: int = 1
    hint: str = ""
    headline: bool = False

    @property
    def is_error(self) -> bool:
        """Whether it forbids the program."""
        return self.severity is Severity.ERROR

    @property
    def place(self) -> tuple[str, int]:
        """File and line, no file and line 1 where no line is to blame."""
        return (self.source.path, self.source.line) if self.source else ("", 1)

    def __str__(self) -> str:
        """Return ``FILE:LINE: severity CODE: message``."""
        place = f"{self.source}: " if self.source else ""
        more = f" ({self.count} times)" if self.count > 1 else ""
        return f"{place}{self.severity} {self.code}: {self.message}{more}"


class PostprocError(Exception):
    """Base of all expected errors: wrong input or a wrong call.

    Args:
        code: stable code such as ``APT012``.
        message: what is wrong and what was expected, one line.
        source: where in the input.
        hint: what to do about it, shown on a following line.
    """

    def __init__(
        self, code: str, message: str, source: SourceRef | None = None, hint: str = ""
    ) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
        self.source = source
        self.hint = hint

    def __str__(self) -> str:
        """Return ``FILE:LINE: error CODE: message`` on one line, whatever the message holds."""
        source = self.source or SourceRef("postproc")
        one_line = " ".join(self.message.split())
        return f"{source}: error {self.code}: {one_line}"

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by the constructor's own arguments (errors cross process borders in a batch)."""
        return (type(self), (self.code, self.message, self.source, self.hint))


class UsageError(PostprocError):
    """The command line is wrong."""


class ReadError(PostprocError, ValueError):
    """An input file cannot be read as what it claims to be."""


class CellError(PostprocError, ValueError):
    """The cell file is wrong or names something that is not there."""


class KinematicsError(PostprocError, ValueError):
    """The robot's geometry cannot be used as asked."""


class StiffnessError(PostprocError, ValueError):
    """Stiffness data are not physical or not sufficient."""


class PlanError(PostprocError):
    """No plan can be made, for a reason other than single failing tags."""


class EmitError(PostprocError):
    """The emitter cannot express the plan."""


class KrlError(PostprocError, ValueError):
    """A KRL program cannot be read."""


class DataError(PostprocError, ValueError):
    """A measurement or model file is wrong or lacks a column."""


class PluginError(PostprocError):
    """A plug-in cannot be loaded or breaks its contract."""


_URGENCY = {Severity.ERROR: 0, Severity.WARNING: 1, Severity.NOTE: 2}


def fold(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Fold findings of equal severity, code and message into the first of them with a count.

    What forbids a program stands first, then warnings, then notes; each in the order found, but
    for headlines.
    """
    first: dict[tuple[str, str, str], Finding] = {}
    for finding in findings:
        key = (finding.severity, finding.code, finding.message)
        known = first.get(key)
        first[key] = replace(known, count=known.count + finding.count) if known else finding
    return tuple(sorted(first.values(), key=lambda f: (_URGENCY[f.severity], not f.headline)))


def headlines(findings: Iterable[Finding]) -> list[str]:
    """Return in words what the first lines of an answer say beside good or bad."""
    return [finding.message for finding in findings if finding.headline and not finding.is_error]
