"""Which column of a point list means what: the roles of ``roles`` and the unit of each column.

What can change the motion and is not understood is asked back by its name, never left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from unicodedata import combining, normalize

from postproc.model import WordClass, WordUse
from postproc.readers.base import ReadOptions
from postproc.readers.csv.roles import BY_NAME, HARMLESS, ROLES, Role, roles_spelled
from postproc.readers.csv.table import Layout, is_number
from postproc.readers.text import Faults, parse_number
from postproc.records import dataclass
from postproc.units import MM, Dimension, Unit, unit_named

_BRACKETS = re.compile(r"[\[({<](.*?)[\])}>]")
_NO_UNIT = frozenset({"", "-", "1"})
"""What brackets hold beside a number without a unit."""
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")
_BORDER = re.compile(r"^|[\s_\-,;:/]+|(?<=\w)\.(?=\s|$)|(?=\u00b0)")
_SYMBOL = re.compile(r"[^\w\s.,;:#'\"/()\[\]{}<>-]")
"""What stands in no name: %, =, * say something that is not understood."""
_WORD = re.compile(r"[^\W_]+")
_NOISE_WORDS = (
    "coord coords coordinate coordinates koordinate koordinaten coordonnee pos position loc "
    "location point punkt value wert valeur tcp tool hole bohrung trou centre center in of de du "
    "la le achse axe nominal nom nominell soll sollwert theoretical theo theoretisch theorique"
)
_NOISE = frozenset(_NOISE_WORDS.split())
"""Words beside a role that do not change it."""
_LONGEST = 80
"""Characters of a name; a longer text is none."""
_UNKNOWN = "no column of this name or unit is known"
_OF_UNIT = {Dimension.TURNS: "spindle", Dimension.SPEED: "feed"}
"""Roles whose name may be no more than their unit: rpm, mm/min."""
_UNCERTAIN = re.compile(
    r"\b(u[xyz]? ?\(? ?95|u ?mag|unc(ertainty)?|sigma|std|rms|\u00b1)|\b9\d(\.\d+)? ?%",
    re.IGNORECASE,
)
"""How trackers name columns that say how sure a coordinate is."""
_MAYBE_UNCERTAIN = ("ux", "uy", "uz")
"""Names of a unit vector for some, of uncertainties for trackers: the numbers tell."""
_UNIT_LENGTH = 0.05
POSITION = ("x", "y", "z")
NORMAL = ("i", "j", "k")
ORIENTATIONS = (("a", "b", "c"), ("roll", "pitch", "yaw"), ("qw", "qx", "qy", "qz"))
_HEADERLESS = {3: POSITION, 6: (*POSITION, *NORMAL)}
_WITH_SPEED = {4: (*POSITION, "speed"), 7: (*POSITION, *NORMAL, "speed")}
"""Without a header: the last column may be left empty, so it is no coordinate; as RoboDK has it."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its ``role`` (empty: left out), its name in the file, and the unit in its name.

    ``question``: why it is not understood, empty where it is.
    """

    role: str
    name: str
    unit: Unit | None = None
    question: str = ""


def column_of(name: str) -> Column:
    """Return what a header name means.

    >>> column_of("MX Coord.").role, column_of("X [mm]").unit.factor, column_of("normal_x").role
    ('x', 0.001, 'i')
    >>> column_of("Drehzahl [1/min]").role, column_of("feed_mm_s").role, column_of("rx").question
    ('spindle', 'feed', 'its unit is not said')
    """
    name = name.strip()
    text = name.strip('"').strip()
    if len(text) > _LONGEST:
        return Column("", name, question=_UNKNOWN)
    if _UNCERTAIN.search(text.replace("_", " ")):
        return Column("", name)
    found = [_meant(words, unit) for words, unit in _readings(text)]
    known = [column for column in found if column is not None]
    if not known:  # what stands in brackets may be a unit that is not known
        column = _meant(_words(_BRACKETS.sub(" ", text)), None)
        question = "its unit is not known" if column is not None and column.role else _UNKNOWN
        known = [replace(column or Column("", ""), question=question)]
    clear = [column for column in known if not column.question]
    return replace((clear or known)[0], name=name)


def _readings(text: str) -> Iterator[tuple[tuple[str, ...], Unit | None]]:
    """Yield the words of a name and the unit behind them, the longest unit first."""
    match = _BRACKETS.search(text)
    if match:
        inside, outside = match.group(1).strip(), text[: match.start()] + " " + text[match.end() :]
        unit = unit_named(inside)
        if unit is not None or inside in _NO_UNIT:
            yield _words(outside), unit
            return
        text = _BRACKETS.sub(r" \1 ", text)
    text = _HUMP.sub(" ", text)
    for border in _BORDER.finditer(text):
        unit = unit_named(text[border.end() :])
        if unit is not None:
            yield _words(text[: border.start()]), unit
    if not _SYMBOL.search(text):
        yield _words(text), None


def _words(text: str) -> tuple[str, ...]:
    plain = normalize("NFKD", text).lower()
    return tuple(_WORD.findall("".join(c for c in plain if not combining(c))))


def _meant(words: tuple[str, ...], unit: Unit | None) -> Column | None:
    """Return what a name with a unit means, None where the words mean nothing."""
    bare = tuple(word for word in words if word not in _NOISE)
    known = _spelled(words) or _spelled(bare)
    if not words and unit is not None and unit.dimension in _OF_UNIT:
        known = [(BY_NAME[_OF_UNIT[unit.dimension]], False)]
    if not known:
        return Column("", "") if HARMLESS & {"".join(words), "".join(bare)} else None
    first = known[0][0].name
    if unit is not None:
        fit = [role.name for role, _ in known if unit.dimension in role.dimensions]
        if fit:
            return Column(fit[0], "", unit)
        return Column(first, "", question=f"no unit of this {first} is known")
    clear = [role.name for role, needs_unit in known if not needs_unit]
    if clear or first == "spindle":
        return Column(clear[0] if clear else first, "")
    return Column(first if len(known) == 1 else "", "", question="its unit is not said")


def _spelled(words: tuple[str, ...]) -> list[tuple[Role, bool]]:
    """Return the roles that words name together, or that both parts of them name: Drehzahl n."""
    whole = roles_spelled("".join(words))
    for cut in range(1, len(words) if not whole else 0):
        parts = [dict(roles_spelled("".join(part))) for part in (words[:cut], words[cut:])]
        both = [(r, n and parts[1][r]) for r, n in parts[0].items() if r in parts[1]]
        whole = whole or both
    return whole


def columns_of(layout: Layout, options: ReadOptions, faults: Faults) -> list[Column]:
    """Return what each column means: as asked for, by the header, or by their number.

    Columns that are not understood have a ``question``.
    """
    if options.columns is not None:
        columns = _asked_columns(options.columns, layout, faults)
    elif layout.header is not None:
        columns = _without_uncertainties(_of_header(layout), layout)
    else:
        columns = _counted_columns(layout, faults)
    columns = _first_of_each(columns, faults, layout)
    missing = [role for role in POSITION if role not in {column.role for column in columns}]
    if missing:
        seen = ", ".join(column.name or "-" for column in columns)
        text = f"no column {', '.join(missing)} among {seen}"
        hint = "name the columns in order with --columns, such as id,x,y,z,i,j,k"
        raise faults.error("CSV010", text, layout.header_line or 1, hint=hint)
    bare = _bare_beside_units(columns) if options.units is None else ""
    present = frozenset(column.role for column in columns)
    return [_in_company(column, columns, present, bare) for column in columns]


def _of_header(layout: Layout) -> list[Column]:
    """Return the columns of a header; one without a name is an index in front, else it is empty."""
    columns = [column_of(name) for name in layout.header or ()]
    for i, column in enumerate(columns):
        if not column.name.strip(' "'):
            is_empty = i == 0 or not (layout.first_row[i : i + 1] or ("",))[0]
            question = "" if is_empty else "a column of values without a name"
            columns[i] = Column("", f"column {i + 1}", question=question)
    return columns


def _bare_beside_units(columns: list[Column]) -> str:
    """Return the column whose unit makes those without one (mm) doubtful, empty if none does."""
    for column in columns:
        unit = column.unit
        if unit is None or column.role == "diameter":
            continue
        if unit.imperial or (unit.dimension is Dimension.LENGTH and unit.factor != MM):
            return column.name
    return ""


def _in_company(
    column: Column, columns: list[Column], present: frozenset[str], stated: str
) -> Column:
    """Return a column with the question that the others raise; ``present``: their roles."""
    role = column.role
    if column.question or not role:
        return column
    question = ""
    metric = {Dimension.LENGTH, Dimension.SPEED} & set(BY_NAME[role].dimensions)
    if stated and metric and column.unit is None and role != "diameter":
        question = f"no unit, beside {stated}"
    forms = [form for form in (NORMAL, *ORIENTATIONS) if role in form]
    whole = [form for form in (NORMAL, *ORIENTATIONS) if present.issuperset(form)]
    if forms and whole and not present.issuperset(forms[0]):
        question = f"one of {', '.join(forms[0])}, which are not all there"
    rad = [o for o in columns if forms and o.role in forms[0] and o.unit and o.unit.factor == 1.0]
    if rad and column.unit is None and role not in NORMAL:
        question = f"no unit, beside {rad[0].name}"
    if "spindle" not in present:
        if role == "sense":
            question = "a sense of rotation without a speed"
        if column.unit and column.unit.dimension is Dimension.ADVANCE:
            question = "a feed per turn without a spindle speed"
    return replace(column, question=question)


def understood(
    columns: list[Column], options: ReadOptions, faults: Faults, line: int
) -> tuple[list[Column], tuple[WordUse, ...]]:
    """Return the columns without those that are not understood, and what to say of these.

    Coordinates stay, in the usual unit. A column that was not accepted is the error CSV016, unless
    the file is only looked at.
    """
    uses = tuple(
        WordUse(column.name, WordClass.UNKNOWN, (line,), column.question, True)
        for column in columns
        if column.question
    )
    known = {word.strip().upper() for word in options.accept_words}
    refused = [use for use in uses if not use.is_named_by(known)]
    if refused and not options.points_only:
        raise faults.error(
            "CSV016",
            "not understood: " + "; ".join(f"column {u.word} ({u.reason})" for u in refused),
            line,
            hint="name it with its unit in the header or with --columns (rx_deg, feed_mm_s, "
            "rpm; - leaves one out); where you know it to be harmless: "
            f'--accept-words "{",".join(use.word for use in refused)}"',
        )
    kept = (c.role if c.role in POSITION or not c.question else "" for c in columns)
    return [replace(c, role=r, question="") for c, r in zip(columns, kept, strict=True)], uses


def _without_uncertainties(columns: list[Column], layout: Layout) -> list[Column]:
    """Return the columns; Ux, Uy, Uz are axes only where they have length one."""
    at = [i for i, c in enumerate(columns) if "".join(_words(c.name)) in _MAYBE_UNCERTAIN]
    row = layout.first_row
    if not at or max(at) >= len(row):
        return columns
    texts = [row[i].replace(",", ".") if layout.decimal_comma else row[i] for i in at]
    values = [parse_number(text) for text in texts]
    length = sum((value or 0.0) ** 2 for value in values) ** 0.5
    if len(at) == len(_MAYBE_UNCERTAIN) and abs(length - 1.0) < _UNIT_LENGTH:
        return columns
    return [Column("", c.name) if i in at else c for i, c in enumerate(columns)]


def _asked_columns(names: tuple[str, ...] | str, layout: Layout, faults: Faults) -> list[Column]:
    listed = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    columns = [Column("", "-") if name == "-" else column_of(name) for name in listed]
    unknown = [c.name for c in columns if c.question == _UNKNOWN]
    if unknown:
        text = (
            f"--columns: {unknown[0]!r} is no column, known are "
            f"{' '.join(role.name for role in ROLES)} and - for one to leave out"
        )
        raise faults.error("CSV011", text, 1)
    if len(columns) != layout.width:
        message = f"--columns names {len(columns)} columns, the file has {layout.width}"
        raise faults.error("CSV012", message, layout.first_row_line)
    return columns


def _counted_columns(layout: Layout, faults: Faults) -> list[Column]:
    row = layout.first_row
    named = bool(row) and not is_number(row[0], layout.decimal_comma)
    count = layout.width - named
    roles = _HEADERLESS.get(count)
    if roles is None and layout.has_gaps_at_end:
        roles = _WITH_SPEED.get(count)
    if roles is None:
        text = f"{layout.width} columns without a header, expected 3 (x,y,z) or 6 (x,y,z,i,j,k)"
        hint = "name the columns in order with --columns, such as x,y,z,w,p,r,id"
        raise faults.error("CSV013", text, layout.first_row_line, hint=hint)
    listed = (("id",) if named else ()) + tuple(roles)
    if "speed" in listed:
        text = "column speed: speeds without a unit, read as mm/s as RoboDK has them"
        faults.warn("CSV122", text, layout.first_row_line)
    robodk = Column("feed", "speed", unit_named("mm/s"))
    return [robodk if role == "speed" else Column(role, role) for role in listed]


def _first_of_each(columns: list[Column], faults: Faults, layout: Layout) -> list[Column]:
    """Keep the first column of each role; two of a coordinate have no single meaning."""
    result: list[Column] = []
    seen: set[str] = set()
    clear = {column.role for column in columns if not column.question}
    for column in columns:
        if column.question and column.role in clear:
            column = replace(column, role="")
        if column.role in seen and column.role != "id":
            text = f"two columns for {column.role}, the second is {column.name!r}"
            hint = "choose with --columns, - leaves a column out"
            raise faults.error("CSV014", text, layout.header_line or 1, hint=hint)
        result.append(Column("", column.name) if column.role in seen else column)
        seen.add(column.role)
        seen.discard("")
    return result
