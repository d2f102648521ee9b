"""One APT statement as data, and a block of text to columns: most of it without a Python loop.

Nine lines in ten of a long file are points. They are recognised by their first bytes, cut at the
commas and evaluated by columns; every line that is in any way unusual takes the slow way through
``parse_statement`` and gives the same columns.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import BoolArray, ByteArray, FloatArray, IndexArray
from postproc.readers.text import (
    LARGEST,
    Faults,
    TextBlock,
    check_line_length,
    last_line_end,
    parse_number,
    parse_tokens,
    text_blocks,
    trim_end,
    trim_start,
)
from postproc.records import dataclass

FREE_TEXT = ("PARTNO", "PPRINT", "TPRINT", "INSERT")
"""Words after which everything to the end of the line is text, commas and slashes included."""
_FREE_TEXT = re.compile(r"(PARTNO|PPRINT|TPRINT|INSERT)(?=[\s/]|$)", re.IGNORECASE)
_SIEMENS_CALL = re.compile(r"\s*(?:MCALL\s+)?(CYCLE8\d)\s*\((.*)\)\s*$", re.IGNORECASE)
_BLANKS = re.compile(r"\s+")


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement: ``word`` in upper case, ``args`` stripped, ``text`` as it stands in the file.

    ``upper``: the arguments in upper case.
    """

    word: str
    args: tuple[str, ...]
    text: str
    upper: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Fill in ``upper``."""
        object.__setattr__(self, "upper", tuple(arg.upper() for arg in self.args))

    @property
    def free_text(self) -> str:
        """What stands after the slash, else after the word."""
        if self.word in FREE_TEXT:
            return self.args[0] if self.args else ""
        _, slash, rest = self.text.partition("/")
        return (rest if slash else self.text[len(self.word) :]).strip()

    def numbers(self) -> list[float | None]:
        """Return the arguments as numbers, None where one is a word, empty or out of range."""
        return [bounded(arg) for arg in self.args]


def bounded(text: str) -> float | None:
    """Return a number of believable size, else None."""
    value = parse_number(text)
    return value if value is not None and abs(value) <= LARGEST else None


def is_free_text(text: str) -> bool:
    """Return whether a line is a word followed by free text."""
    return _FREE_TEXT.match(text) is not None


def parse_statement(text: str) -> Statement:
    """Return the statement of a joined line (continuations appended, comment lines excluded)."""
    text = text.strip()
    match = _FREE_TEXT.match(text)
    if match:
        word = match.group(1).upper()
        rest = text[match.end() :].strip().removeprefix("/").strip()
        return Statement(word, (rest,) if rest else (), text)
    body = text.partition("$$")[0]
    call = _SIEMENS_CALL.match(body)
    if call:
        return Statement(call.group(1).upper(), _arguments(call.group(2)), text)
    head, slash, rest = body.partition("/")
    word = _BLANKS.sub(" ", head.strip()).upper()
    return Statement(word, _arguments(rest) if slash else (), text)


def _arguments(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",")) if text.strip() else ()


COMMENT = "$$"
"""Word of a comment line."""
SKIP, GOTO, CIRCLE, RAPID, OTHER = 0, 1, 2, 3, 4
CIRCLE_FIELDS = 8
"""Centre, vector, radius and, in a record of 11 numbers, the eighth; NaN where not given."""
_GOTO_COUNTS = (3, 6)
_CIRCLE_COUNTS = (6, 7, 11)
_FOLD = 0xDF
_WINDOW = 8


@dataclass(slots=True)
class Scan:
    """One block: what each line is, the numbers of its points and arcs, and the other statements.

    ``code`` (lines,); ``goto`` (k, 6) in line order, NaN where no axis was given; ``circle``
    (m, 8) in line order, as ``CIRCLE_FIELDS`` says; ``others``: line index and statement.
    ``displayed``: number of PAINT lines left out.
    """

    block: TextBlock
    code: NDArray[np.int8]
    goto: FloatArray
    circle: FloatArray
    others: list[tuple[int, Statement]] = field(default_factory=list)
    displayed: int = 0

    def line(self, index: int) -> int:
        """Return the 1-based number of a line of the block."""
        return self.block.first_line + index


def scan(block: TextBlock, faults: Faults) -> Scan:
    """Return the columns of a block."""
    buffer = np.frombuffer(block.data, dtype=np.uint8)
    line_ends = np.flatnonzero(buffer == ord("\n"))
    starts = np.concatenate([[0], line_ends[:-1] + 1])
    longest = int((line_ends - starts).argmax())
    check_line_length(
        faults.path, int(line_ends[longest] - starts[longest]), block.first_line + longest
    )
    ends = trim_end(buffer, starts, line_ends)
    code = _codes(buffer, starts, ends)
    result = Scan(block, code, np.zeros((0, 6)), np.zeros((0, CIRCLE_FIELDS)))
    result.displayed = int((code == SKIP).sum())
    joined = _join_dollar_lines(block, faults, starts, ends, code)
    code[(ends == starts) & (code == OTHER)] = SKIP
    goto = _bulk_numbers(buffer, starts, ends, code, GOTO)
    circle = _bulk_numbers(buffer, starts, ends, code, CIRCLE)
    rest = np.flatnonzero(code == OTHER)
    result.others = _statements(block, starts, ends, rest, joined)
    result.goto, result.circle = goto, circle
    return result


def _codes(buffer: ByteArray, starts: IndexArray, ends: IndexArray) -> NDArray[np.int8]:
    """Return what the first bytes of each line say; OTHER for everything unusual."""
    padded = np.concatenate([buffer, np.zeros(_WINDOW, dtype=np.uint8)])
    head = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW)[starts]
    folded = (head & _FOLD).view(np.uint64)[:, 0]
    code = np.full(len(starts), OTHER, dtype=np.int8)

    def begins(word: bytes) -> BoolArray:
        value = np.frombuffer(word.ljust(_WINDOW, b"\0"), dtype=np.uint64)[0]
        mask = np.frombuffer((b"\xff" * len(word)).ljust(_WINDOW, b"\0"), dtype=np.uint64)[0]
        after = head[:, len(word)]
        ended = (after == ord("/")) | (after == ord(" "))
        return np.asarray(((folded & mask) == value) & ended)

    code[begins(b"GOTO")] = GOTO
    code[begins(b"CIRCLE")] = CIRCLE
    code[begins(b"PAINT")] = SKIP
    rapid = np.frombuffer(b"RAPID\0\0\0", dtype=np.uint64)[0]
    length = ends - starts
    five = (folded & np.uint64(0xFFFFFFFFFF)) == rapid
    code[five & ((length == 5) | ((length == 6) & (head[:, 5] == ord("/"))))] = RAPID
    return code


def _join_dollar_lines(
    block: TextBlock, faults: Faults, starts: IndexArray, ends: IndexArray, code: NDArray[np.int8]
) -> dict[int, str]:
    """Return the joined text of continued statements by their first line, in place in ``code``."""
    dollars = np.flatnonzero(np.frombuffer(block.data, dtype=np.uint8) == ord("$"))
    if len(dollars) == 0:
        return {}
    lines = np.unique(np.searchsorted(starts, dollars, side="right") - 1)
    code[lines] = OTHER
    joined: dict[int, str] = {}
    done = -1
    for line in lines.tolist():
        if line <= done:
            continue
        raw = block.data[starts[line] : ends[line]]
        if not is_continued(raw) or is_free_text(raw.decode("latin-1").strip()):
            continue
        parts = [_before_dollar(raw)]
        begin, done = int(starts[line]), line + 1
        while True:
            if done >= len(starts):
                text = "the file ends inside a statement continued by $"
                raise faults.error("APT006", text, block.first_line + line)
            check_line_length(faults.path, int(ends[done]) - begin, block.first_line + line)
            raw = block.data[starts[done] : ends[done]]
            code[done] = SKIP
            parts.append(_before_dollar(raw))
            if not is_continued(raw):
                break
            done += 1
        joined[line] = " ".join(parts)
    return joined


def _before_dollar(raw: bytes) -> str:
    text = raw.decode("latin-1").strip()
    at = text.find("$", 2 if text.startswith("$$") else 0)
    return text if at < 0 else text[:at]


def _bulk_numbers(
    buffer: ByteArray, starts: IndexArray, ends: IndexArray, code: NDArray[np.int8], kind: int
) -> FloatArray:
    """Return the numbers of all lines of one kind; lines that are unusual become OTHER."""
    width, counts = (6, _GOTO_COUNTS) if kind == GOTO else (CIRCLE_FIELDS, _CIRCLE_COUNTS)
    lines = np.flatnonzero(code == kind)
    values = np.full((len(lines), width), np.nan)
    good = np.zeros(len(lines), dtype=np.bool_)
    if len(lines) == 0:
        return values
    slash = _slashes(buffer, starts[lines] + (4 if kind == GOTO else 6), ends[lines])
    commas = np.flatnonzero(buffer == ord(","))
    first = np.searchsorted(commas, starts[lines])
    fields = np.searchsorted(commas, ends[lines]) - first + 1
    fields[slash < 0] = 0
    for count in counts:
        rows = np.flatnonzero(fields == count)
        if len(rows) == 0:
            continue
        between = commas[first[rows][:, None] + np.arange(count - 1)]
        begin = np.concatenate([slash[rows][:, None] + 1, between + 1], axis=1)
        end = np.concatenate([between, ends[lines[rows]][:, None]], axis=1)
        numbers, valid = parse_tokens(buffer, begin.ravel(), end.ravel())
        fine = valid & (np.abs(numbers) <= LARGEST)
        good[rows] = fine.reshape(-1, count).all(axis=1)
        used = min(count, width)
        values[rows, :used] = numbers.reshape(-1, count)[:, :used]
    code[lines[~good]] = OTHER
    return values[good]


def _slashes(buffer: ByteArray, after: IndexArray, ends: IndexArray) -> IndexArray:
    """Return the position of the slash that follows the word, after blanks only; -1 if none."""
    at = trim_start(buffer, after, ends)
    last = len(buffer) - 1
    found = (at < ends) & (buffer[np.minimum(at, last)] == ord("/"))
    return np.where(found, at, -1)


def _statements(
    block: TextBlock,
    starts: IndexArray,
    ends: IndexArray,
    lines: IndexArray,
    joined: dict[int, str],
) -> list[tuple[int, Statement]]:
    """Return the statements of these lines; equal texts are parsed once."""
    text = block.data.decode("latin-1")
    result: list[tuple[int, Statement]] = []
    for line, begin, end in zip(
        lines.tolist(), starts[lines].tolist(), ends[lines].tolist(), strict=True
    ):
        whole = joined.get(line)
        if whole is None:
            whole = text[begin:end]
        if whole.lstrip().startswith("$$"):
            result.append((line, Statement(COMMENT, (), whole.strip())))
        else:
            result.append((line, _parsed(whole)))
    return result


_parsed = lru_cache(maxsize=1 << 14)(parse_statement)


def statement_blocks(path: str) -> Iterator[TextBlock]:
    """Yield the lines of a file in blocks that end between two statements."""
    return text_blocks(path, _cut)


def _cut(data: bytes) -> int:
    """Return where the last statement that is surely whole ends."""
    end = last_line_end(data)
    while end:
        previous = data.rfind(b"\n", 0, end - 1) + 1
        if not is_continued(data[previous:end]):
            break
        end = previous
    return end


def is_continued(line: bytes) -> bool:
    """Return whether a single ``$`` asks for the next line to be appended."""
    text = line.strip()
    if text.startswith(b"$$"):
        return text.startswith(b"$$->") and text.endswith(b"$")
    at = text.find(b"$")
    return at >= 0 and text[at : at + 2] != b"$$"
