"""Which column of a point list means what: names as people and CAD systems write them."""

from __future__ import annotations

import re

from postproc.readers.csv.table import Layout, is_number
from postproc.readers.text import Faults, parse_number
from postproc.records import dataclass
from postproc.units import DEG, INCH, INCH_PER_MIN, MM, MM_PER_MIN

_BRACKETS = re.compile(r"[\[({<](.*?)[\])}>]")
_NOISE = re.compile(
    r"\b(coord(inate)?s?|koordinate|pos(ition)?|loc(ation)?|point|value|wert|tcp|tool|hole|centre|center)\b"
)
_UNIT_SUFFIX = re.compile(r"_(mm|m|in|inch|deg|rad|mm_min|mm_per_min|m_s|s|mmpm|ipm)$")

_LENGTHS = {"mm": MM, "millimeter": MM, "millimetre": MM, "m": 1.0, "in": INCH, "inch": INCH,
            "inches": INCH, '"': INCH, "cm": 10.0 * MM, "um": 1e-3 * MM, "\u00b5m": 1e-3 * MM,
            "\u03bcm": 1e-3 * MM}  # fmt: skip
_ANGLES = {"deg": DEG, "degree": DEG, "degrees": DEG, "\u00b0": DEG, "rad": 1.0, "radian": 1.0,
           "grad": DEG}  # fmt: skip
_FEEDS = {"mm/min": MM_PER_MIN, "mm_min": MM_PER_MIN, "mm_per_min": MM_PER_MIN, "mmpm": MM_PER_MIN,
          "mm/s": MM, "m/s": 1.0, "m_s": 1.0, "m/min": 1.0 / 60.0, "in/min": INCH_PER_MIN,
          "ipm": INCH_PER_MIN}  # fmt: skip

NAMES: dict[str, tuple[str, ...]] = {
    "x": ("x", "mx", "px", "xpos", "posx", "x1"),
    "y": ("y", "my", "py", "ypos", "posy", "y1"),
    "z": ("z", "mz", "pz", "zpos", "posz", "z1"),
    "i": ("i", "nx", "vx", "ni", "normalx", "normali", "xn", "axisi", "axisx", "ux", "dirx",
          "vectorx", "vecx", "directionx"),
    "j": ("j", "ny", "vy", "nj", "normaly", "normalj", "yn", "axisj", "axisy", "uy", "diry",
          "vectory", "vecy", "directiony"),
    "k": ("k", "nz", "vz", "nk", "normalz", "normalk", "zn", "axisk", "axisz", "uz", "dirz",
          "vectorz", "vecz", "directionz"),
    "a": ("a", "kukaa"),
    "b": ("b", "kukab"),
    "c": ("c", "kukac"),
    "roll": ("roll", "rx", "w", "rotx"),
    "pitch": ("pitch", "ry", "p", "roty"),
    "yaw": ("yaw", "rz", "r", "rotz"),
    "qw": ("qw", "q0", "quatw"),
    "qx": ("qx", "q1", "quatx"),
    "qy": ("qy", "q2", "quaty"),
    "qz": ("qz", "q3", "quatz"),
    "id": ("id", "name", "tag", "label", "no", "nr", "index", "elementname", "element", "pointname",
           "pointid", "holeid", "holename", "pointno", "", "feature", "featurename", "bezeichnung",
           "fastener", "fastenerid", "fastenername", "fastenerno", "rivet", "bolt", "target"),
    "depth": ("depth", "tiefe", "drilldepth", "bore depth"),
    "diameter": ("diameter", "dia", "d", "durchmesser", "holediameter", "\u00f8"),
    "feed": ("feed", "feedrate", "f", "vorschub", "speed", "linearspeed"),
    "operation": ("operation", "op", "process", "step", "bearbeitung"),
    "tool": ("tool", "toolnumber", "toolno", "t", "werkzeug"),
    "base": ("base", "setup", "workoffset", "werkstueck", "basis"),
    "clearance": ("clearance", "approach", "safety", "rapto"),
    "retract": ("retract", "retraction", "rtrcto"),
    "dwell": ("dwell", "dwelltime"),
    "peck": ("peck", "pecking", "peckdepth"),
    "motion": ("motion", "move", "movetype", "motiontype"),
}  # fmt: skip
"""Spellings of each role, without case, blanks and unit."""
MEANINGS = {
    "x": "point: tip of the tool, top of a hole", "y": "the same", "z": "the same",
    "i": "tool axis, from the tip into the holder", "j": "the same", "k": "the same",
    "a": "KUKA A of the tool frame, in place of i, j, k", "b": "KUKA B", "c": "KUKA C",
    "roll": "rotation about x, in place of i, j, k: R = Rz(yaw) Ry(pitch) Rx(roll)",
    "pitch": "rotation about y", "yaw": "rotation about z",
    "qw": "quaternion of the tool frame, in place of i, j, k", "qx": "x of it", "qy": "y of it",
    "qz": "z of it",
    "id": "name of the point, used in messages and pins",
    "depth": "the point is a hole of this depth below it, along the tool axis",
    "diameter": "of the hole; shown, not used for the motion",
    "feed": "cutting feed, mm/min",
    "operation": "name of the operation that the row belongs to",
    "tool": "number or name of the tool, as a tool of the cell claims it",
    "base": "number or name of the setup, as a base of the cell claims it",
    "clearance": "height above the hole from which it is fed",
    "retract": "height above the hole to which the tool is withdrawn",
    "dwell": "time at the bottom, s",
    "peck": "depth of one peck",
    "motion": "rapid or linear",
}  # fmt: skip
_ROLE = {name: role for role, names in NAMES.items() for name in names}
_UNCERTAIN = re.compile(
    r"\b(u[xyz]? ?\(? ?95|u ?mag|unc(ertainty)?|sigma|std|rms|\u00b1)|\b9\d(\.\d+)? ?%",
    re.IGNORECASE,
)
"""How trackers name columns that say how sure a coordinate is."""
_MAYBE_UNCERTAIN = ("ux", "uy", "uz")
"""Names of a unit vector for some, of uncertainties for trackers: the numbers tell."""
_POINT_WORDS = frozenset({"point", "points", "hole", "tag", "punkt", "bohrung"})
_UNIT_LENGTH = 0.05
LENGTH_ROLES = frozenset({"x", "y", "z", "depth", "diameter", "clearance", "retract", "peck"})
_ANGLE_ROLES = frozenset({"a", "b", "c", "roll", "pitch", "yaw"})
TEXT_ROLES = frozenset({"id", "operation", "motion", "tool", "base"})
POSITION = ("x", "y", "z")
NORMAL = ("i", "j", "k")
_HEADERLESS = {3: POSITION, 6: (*POSITION, *NORMAL)}
_WITH_SPEED = {4: (*POSITION, "speed"), 7: (*POSITION, *NORMAL, "speed")}
"""Without a header: the last column may be left empty, so it is no coordinate; as RoboDK has it."""
ORIENTATIONS = (("a", "b", "c"), ("roll", "pitch", "yaw"), ("qw", "qx", "qy", "qz"))


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its ``role`` (empty if unknown), its name in the file, and the factor to SI.

    ``factor`` is None where the name gives no unit.
    """

    role: str
    name: str
    factor: float | None = None


def column_of(name: str) -> Column:
    """Return what a header name means.

    >>> column_of("MX Coord.").role, column_of("X [mm]").factor, column_of("normal_x").role
    ('x', 0.001, 'i')
    """
    bare = name.strip().strip('"').strip()
    if _UNCERTAIN.search(bare.replace("_", " ")):
        return Column("", name.strip())
    unit = ""
    match = _BRACKETS.search(bare)
    if match:
        unit, bare = match.group(1).strip().lower(), _BRACKETS.sub(" ", bare).strip()
    lowered = bare.lower().replace(" ", "_")
    suffix = _UNIT_SUFFIX.search(lowered)
    if suffix and not unit:
        unit, lowered = suffix.group(1), lowered[: suffix.start()]
    role = _role(lowered)
    if role == "feed" and "speed" in lowered and not unit:
        unit = "mm/s"
    return Column(role, name.strip(), _factor(role, unit))


def _role(lowered: str) -> str:
    words = re.sub(r"[^\w\u00f8]+", " ", lowered.replace("_", " ")).strip()
    for candidate in (words, _NOISE.sub(" ", words)):
        role = _ROLE.get(candidate.replace(" ", ""))
        if role is not None and (role != "id" or candidate.strip()):
            return role
    return "id" if words in _POINT_WORDS else ""


def _factor(role: str, unit: str) -> float | None:
    if role in LENGTH_ROLES:
        return _LENGTHS.get(unit)
    if role in _ANGLE_ROLES:
        return _ANGLES.get(unit)
    if role == "feed":
        return _FEEDS.get(unit)
    return None


def columns_of(layout: Layout, asked: tuple[str, ...] | str | None, faults: Faults) -> list[Column]:
    """Return what each column means: as asked for, by the header, or by their number."""
    if asked is not None:
        columns = _asked_columns(asked, layout, faults)
    elif layout.header is not None:
        columns = _without_uncertainties([column_of(name) for name in layout.header], layout)
    else:
        columns = _counted_columns(layout, faults)
    columns = _first_of_each(columns, faults, layout)
    missing = [role for role in POSITION if role not in {column.role for column in columns}]
    if missing:
        seen = ", ".join(column.name or "-" for column in columns)
        raise faults.error(
            "CSV010",
            f"no column {', '.join(missing)} among {seen}",
            layout.header_line or 1,
            hint="name the columns in order with --columns, such as id,x,y,z,i,j,k",
        )
    for column in columns:
        if column.role == "feed" and column.factor == MM and "mm/s" not in column.name:
            text = f"column {column.name}: speeds without a unit, read as mm/s as RoboDK has them"
            faults.warn("CSV122", text, layout.header_line or layout.first_row_line)
    unused = [column.name for column in columns if not column.role and column.name not in ("", "-")]
    if unused and asked is None:
        faults.warn(
            "CSV120",
            f"columns without a meaning here: {', '.join(unused)}",
            layout.header_line or 1,
        )
    return columns


def _without_uncertainties(columns: list[Column], layout: Layout) -> list[Column]:
    """Return the columns; Ux, Uy, Uz are axes only where they have length one."""
    at = [i for i, c in enumerate(columns) if c.name.lower().strip(' "') in _MAYBE_UNCERTAIN]
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
    unknown = [column.name for column in columns if not column.role and column.name != "-"]
    if unknown:
        raise faults.error(
            "CSV011",
            f"--columns: {unknown[0]!r} is no column, known are x y z i j k a b c roll pitch yaw "
            "qw qx qy qz id depth diameter feed operation tool base clearance retract dwell peck "
            "motion "
            "and - for one to leave out",
            1,
        )
    if len(columns) != layout.width:
        raise faults.error(
            "CSV012",
            f"--columns names {len(columns)} columns, the file has {layout.width}",
            layout.first_row_line,
        )
    return columns


def _counted_columns(layout: Layout, faults: Faults) -> list[Column]:
    row = layout.first_row
    named = bool(row) and not is_number(row[0], layout.decimal_comma)
    count = layout.width - named
    roles = _HEADERLESS.get(count)
    if roles is None and layout.has_gaps_at_end:
        roles = _WITH_SPEED.get(count)
    if roles is None:
        raise faults.error(
            "CSV013",
            f"{layout.width} columns without a header, expected 3 (x,y,z) or 6 (x,y,z,i,j,k)",
            layout.first_row_line,
            hint="name the columns in order with --columns, such as x,y,z,w,p,r,id",
        )
    listed = (("id",) if named else ()) + tuple(roles)
    return [column_of(role) if role == "speed" else Column(role, role) for role in listed]


def _first_of_each(columns: list[Column], faults: Faults, layout: Layout) -> list[Column]:
    """Keep the first column of each role; two of a coordinate have no single meaning."""
    result: list[Column] = []
    seen: set[str] = set()
    for column in columns:
        if column.role in seen and column.role != "id":
            raise faults.error(
                "CSV014",
                f"two columns for {column.role}, the second is {column.name!r}",
                layout.header_line or 1,
                hint="choose with --columns, - leaves a column out",
            )
        result.append(Column("", column.name) if column.role in seen else column)
        seen.add(column.role)
        seen.discard("")
    return result
