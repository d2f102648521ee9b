"""Point lists as tables: the layout found from the first rows, then all rows in bulk.

The fields are found by the positions of the separators and evaluated column by column
(``decimals``); a row that is in any way unusual is taken apart on its own.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import field

import numpy as np

from postproc.arrays import BoolArray, ByteArray, FloatArray, IndexArray
from postproc.readers.text import (
    LARGEST,
    Faults,
    TextBlock,
    check_line_length,
    parse_number,
    parse_tokens,
    trim_end,
    trim_start,
)
from postproc.records import dataclass
from postproc.units import unit_named

_SAMPLE_ROWS = 200
_WIDEST_TEXT = 48
_BLANK = " "
_COMMENTS = ("#", "//", "%")
"""How lines begin that are for people."""
_COMMENT_BYTES = np.frombuffer(b"#/%", dtype=np.uint8)
_SEPARATOR = re.compile(r'^"?sep=(.?)"?$', re.IGNORECASE)
"""First line by which a spreadsheet says its separator."""
_NO_UNIT = frozenset({"", "-"})
"""What a row of units holds below a column that has none."""
_DECIMAL_COMMA = re.compile(r"^\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*$")


@dataclass(frozen=True, slots=True)
class Layout:
    """How a file is written: separator (a blank stands for any blanks), decimal sign, width.

    ``header``: names of the first row, None if it holds data; ``header_line``: its number.
    """

    separator: str
    decimal_comma: bool
    width: int
    header: tuple[str, ...] | None
    header_line: int
    first_row: tuple[str, ...] = ()
    """First row of data."""
    first_row_line: int = 0
    has_gaps_at_end: bool = False
    """The last column holds values, and is left empty in some rows."""
    unit_line: int = 0
    """Number of the row below the header that names the units, 0 without one."""


@dataclass(slots=True)
class Rows:
    """Rows of one block: ``line`` (n,), numeric columns (n, c), texts of the text columns.

    ``empty`` (n, c): fields that were left empty, NaN in ``numbers``.
    """

    line: IndexArray
    numbers: FloatArray
    empty: BoolArray
    texts: dict[int, list[str]] = field(default_factory=dict)


def decoded(raw: bytes) -> str:
    """Return text that is UTF-8 if it can be, else Latin-1."""
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def is_comment(text: str) -> bool:
    """Return whether a line, without blanks around it, is none of the table."""
    return text.startswith(_COMMENTS) or _SEPARATOR.match(text) is not None


def is_number(text: str, decimal_comma: bool) -> bool:
    """Return whether a field is a number in the file's way of writing."""
    return parse_number(text.replace(",", ".") if decimal_comma else text) is not None


def layout_of(block: TextBlock, faults: Faults) -> Layout:
    """Return the layout of a file from its first block."""
    rows = list(_sample(block))
    if not rows:
        raise faults.error("CSV002", "no row of data", 1)
    first = block.data[: max(block.data.find(b"\n"), 0)].decode("latin-1").strip(" \r")
    told = _SEPARATOR.match(first) if block.first_line == 1 else None
    separator, decimal_comma = _separator([text for _, text in rows], told and told.group(1))
    fields = [split_row(text, separator) for _, text in rows]
    has_header = _is_header(fields, decimal_comma)
    header = tuple(fields[0]) if has_header else None
    body = fields[1:] if has_header else fields
    units = header is not None and bool(body) and _are_units(body[0])
    if header is not None and units:
        header, body = tuple(map(_with_unit, header, body[0])), body[1:]
    if not body:
        raise faults.error("CSV002", "a header but no row of data", rows[0][0])
    width = len(header) if header is not None else _usual_width(body)
    at = int(has_header) + int(units)
    return Layout(
        separator, decimal_comma, width, header, rows[0][0] if has_header else 0,
        tuple(body[0]), rows[at][0], _has_gaps_at_end(body), rows[1][0] if units else 0,
    )  # fmt: skip


def split_row(text: str, separator: str) -> list[str]:
    """Return the fields of one row, quotes and outer blanks removed."""
    if separator == _BLANK:
        return text.split()
    if '"' in text:
        row = next(csv.reader([text.replace("\r", " ")], delimiter=separator))
        return [part.strip() for part in row]
    return [part.strip() for part in text.split(separator)]


def _sample(block: TextBlock) -> Iterator[tuple[int, str]]:
    """Yield number and text of the first rows, without empty lines and comments."""
    end = 0
    found = 0
    line = block.first_line
    while found < _SAMPLE_ROWS and end < len(block.data):
        begin, end = end, block.data.find(b"\n", end) + 1
        text = decoded(block.data[begin:end]).strip()
        if text and not is_comment(text):
            found += 1
            yield line, text
        line += 1


def _separator(rows: list[str], told: str | None) -> tuple[str, bool]:
    """Return the separator, as the file tells it or as it looks, and whether commas are decimal."""
    body = rows[1:] or rows
    if told == ",":
        return told, False
    for candidate in (told,) if told else (";", "\t"):
        if told or all(candidate in row for row in body):
            fields = [part for row in body for part in row.split(candidate)]
            commas = sum(1 for part in fields if _DECIMAL_COMMA.match(part))
            plain = [part for part in fields if "." in part and parse_number(part) is not None]
            points = sum("," not in part for part in plain)
            return candidate, commas > 0 and (commas >= points or not plain)
    if all("," in row for row in body):
        with_comma = [part for row in body for part in row.split() if "," in part]
        if len(with_comma) >= 3 * len(body) and all(map(_DECIMAL_COMMA.match, with_comma)):
            return _BLANK, True
        return ",", False
    return _BLANK, False


def _is_header(fields: list[list[str]], decimal_comma: bool) -> bool:
    """Return whether the first row names columns: words where the next rows have numbers."""
    first = fields[0]
    numeric = [is_number(part, decimal_comma) for part in first]
    if all(numeric) or sum(numeric) >= 3:
        return False
    return not any(numeric)


def _are_units(row: list[str]) -> bool:
    """Return whether a row holds nothing but names of units and fields without one."""
    names = [part.strip("[]() ") for part in row]
    known = [unit_named(name) is not None for name in names]
    return any(known) and all(k or name in _NO_UNIT for k, name in zip(known, names, strict=True))


def _with_unit(name: str, unit: str) -> str:
    plain = unit.strip("[]() ")
    return name if plain in _NO_UNIT else f"{name} [{plain}]"


def _has_gaps_at_end(rows: list[list[str]]) -> bool:
    widest = max(map(len, rows))
    ends = [row[-1] for row in rows if len(row) == widest]
    return len(ends) == len(rows) and any(ends) and not all(ends)


def _usual_width(rows: list[list[str]]) -> int:
    if _has_gaps_at_end(rows):
        return len(rows[0])
    widths = [len(row) - (1 if row and not row[-1] else 0) for row in rows]
    return max(set(widths), key=lambda width: (widths.count(width), width))


def parse_rows(
    block: TextBlock, layout: Layout, numeric: list[int], texts: list[int], faults: Faults
) -> Rows:
    """Return the rows of a block: the columns ``numeric`` as numbers, others as texts."""
    data = block.data.replace(b",", b".") if layout.decimal_comma else block.data
    buffer = np.frombuffer(data, dtype=np.uint8)
    longest = int(np.diff(np.flatnonzero(buffer == ord("\n")), prepend=-1).max())
    check_line_length(faults.path, longest, block.first_line)
    begins, ends, lines, odd = _fields(buffer, data, block, layout)
    columns = np.array(numeric, dtype=np.int64)
    values, valid = parse_tokens(buffer, begins[:, columns].ravel(), ends[:, columns].ravel())
    shape = (len(lines), len(numeric))
    numbers, good = values.reshape(shape), valid.reshape(shape)
    too_large = np.abs(numbers) > LARGEST
    empty = np.zeros(shape, dtype=np.bool_)
    faulty = np.flatnonzero((~good | too_large).any(axis=1))
    for row in faulty.tolist():
        for at, column in enumerate(numeric):
            if good[row, at] and not too_large[row, at]:
                continue
            raw = data[begins[row, column] : ends[row, column]]
            text = decoded(raw).strip().strip('"').strip()
            numbers[row, at] = _number(text, int(lines[row]), column, layout, faults)
            empty[row, at] = not text
    original = np.frombuffer(block.data, dtype=np.uint8)
    kept = {
        column: _texts(original, block.data, begins[:, column], ends[:, column]) for column in texts
    }
    result = Rows(lines, numbers, empty, kept)
    return _with_odd_rows(result, odd, layout, numeric, texts, faults) if odd else result


def _number(text: str, line: int, column: int, layout: Layout, faults: Faults) -> float:
    """Return the value of an unusual field, NaN if it is empty."""
    if not text:
        return float("nan")
    value = parse_number(text.replace(",", ".") if layout.decimal_comma else text)
    if value is None or abs(value) > LARGEST:
        name = layout.header[column] if layout.header else f"column {column + 1}"
        raise faults.error(
            "CSV004", f"{name} needs a number of at most 1e9, not", line, text or "nothing"
        )
    return value


def _texts(buffer: ByteArray, data: bytes, begins: IndexArray, ends: IndexArray) -> list[str]:
    """Return fields as text: short ASCII ones by columns, others one by one."""
    begins = trim_start(buffer, begins, ends)
    ends = trim_end(buffer, begins, ends)
    length = ends - begins
    width = int(length.max(initial=0))
    if not data.isascii() or not 0 < width <= _WIDEST_TEXT:
        pairs = zip(begins.tolist(), ends.tolist(), strict=True)
        return [decoded(data[begin:end]) for begin, end in pairs]
    padded = np.concatenate([buffer, np.zeros(width, dtype=np.uint8)])
    rows = np.lib.stride_tricks.sliding_window_view(padded, width)[begins]
    rows[np.arange(width) >= length[:, None]] = 0
    texts: list[str] = rows.view(f"S{width}")[:, 0].astype(f"U{width}").tolist()
    return texts


def _fields(
    buffer: ByteArray, data: bytes, block: TextBlock, layout: Layout
) -> tuple[IndexArray, IndexArray, IndexArray, list[tuple[int, str]]]:
    """Return begins (n, width) and ends of the fields of all plain rows, their lines, odd rows."""
    line_ends = np.flatnonzero(buffer == ord("\n"))
    starts = np.concatenate([[0], line_ends[:-1] + 1])
    if layout.separator == _BLANK:
        begin, end = _blank_fields(buffer)
    else:
        begin = end = np.flatnonzero(buffer == ord(layout.separator))
    first = np.searchsorted(begin, starts)
    count = np.searchsorted(begin, line_ends) - first
    quoted = b'"' in data
    wanted = layout.width if layout.separator == _BLANK else layout.width - 1
    header = [line - block.first_line for line in (layout.header_line, layout.unit_line) if line]
    header = [row for row in header if 0 <= row < len(starts)]
    plain = (count == wanted) & ~np.isin(buffer[starts], _COMMENT_BYTES)
    plain[header] = False
    if quoted:
        marks = np.flatnonzero(buffer == ord('"'))
        plain &= np.searchsorted(marks, starts) == np.searchsorted(marks, line_ends)
    rows = np.flatnonzero(plain)
    rows = rows[_not_blank(buffer, starts[rows], line_ends[rows])] if wanted == 0 else rows
    index = first[rows][:, None] + np.arange(wanted)
    if layout.separator == _BLANK:
        begins, ends = begin[index], end[index]
    else:
        between = begin[index]
        begins = np.concatenate([starts[rows][:, None], between + 1], axis=1)
        ends = np.concatenate([between, line_ends[rows][:, None]], axis=1)
    rest = np.flatnonzero(~plain)
    odd = [
        (block.first_line + int(line), decoded(block.data[starts[line] : line_ends[line]]).strip())
        for line in rest.tolist()
        if line not in header
    ]
    odd = [(line, text) for line, text in odd if text and not is_comment(text)]
    return begins, ends, rows + block.first_line, odd


def _blank_fields(buffer: ByteArray) -> tuple[IndexArray, IndexArray]:
    solid = buffer > ord(" ")
    edge = np.flatnonzero(np.diff(np.concatenate([[False], solid, [False]]).astype(np.int8)))
    return edge[0::2], edge[1::2]


def _not_blank(buffer: ByteArray, starts: IndexArray, ends: IndexArray) -> BoolArray:
    solid = np.concatenate([[0], np.cumsum(buffer > ord(" "))])
    return np.asarray(solid[ends] > solid[starts])


def _with_odd_rows(
    rows: Rows,
    odd: list[tuple[int, str]],
    layout: Layout,
    numeric: list[int],
    texts: list[int],
    faults: Faults,
) -> Rows:
    """Merge the rows that were not plain, in line order."""
    lines: list[int] = []
    numbers: list[list[float]] = []
    more: dict[int, list[str]] = {column: [] for column in texts}
    for line, text in odd:
        fields = split_row(text, layout.separator)
        if len(fields) == layout.width + 1 and not fields[-1]:
            fields.pop()
        if len(fields) != layout.width:
            raise faults.error(
                "CSV003", f"{len(fields)} fields, expected {layout.width}", line, text
            )
        lines.append(line)
        numbers.append([_number(fields[c].strip('"'), line, c, layout, faults) for c in numeric])
        for column in texts:
            more[column].append(fields[column])
    if not lines:
        return rows
    order = np.argsort(np.concatenate([rows.line, np.array(lines)]), kind="stable")
    extra = np.array(numbers).reshape(len(lines), len(numeric))
    joined = {
        column: [(rows.texts[column] + more[column])[i] for i in order.tolist()] for column in texts
    }
    return Rows(
        np.concatenate([rows.line, np.array(lines)])[order],
        np.concatenate([rows.numbers, extra])[order],
        np.concatenate([rows.empty, np.isnan(extra)])[order],
        joined,
    )
