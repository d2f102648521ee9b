"""Arcs as statements: CIRCLE, ARC, MOVARC and TLON with the numbers that they hold.

Sources: CIRCLE as measured on files of five systems; MOVARC as the posts of HSM and MfgSuite write
it (its sense is not always in the record); TLON as CATIA and NCL write it.
"""

from __future__ import annotations

import re
from math import isnan, radians

from postproc.readers.apt.statement import Statement, bounded
from postproc.readers.uses import AtLine
from postproc.records import dataclass

NAN = float("nan")
_ELEVEN = 11
_SWEEP_FIELD = 7
_MOST_TURNS = 10_000
_SENSES = {"COUNTERCLOCKWISE": 1.0, "CCLW": 1.0, "CLOCKWISE": -1.0, "CLW": -1.0}
_NUMBERS = r"\s*/([^()]*)\)"
_TLON = re.compile(r"TLON\s*,\s*GO(?:FWD|LFT|RGT|BACK)\s*/\s*\(", re.IGNORECASE)
_CIRCLE = re.compile(r"\(\s*CIRCLE" + _NUMBERS, re.IGNORECASE)
_CANON = re.compile(r"\(\s*CIRCLE\s*/\s*CANON\s*,([^()]*)\)", re.IGNORECASE)
_CYLINDER = re.compile(r"\(\s*CYLNDR" + _NUMBERS, re.IGNORECASE)
_LINE = re.compile(r"\(\s*LINE" + _NUMBERS, re.IGNORECASE)
_PLANE = re.compile(r"\(\s*PLANE" + _NUMBERS, re.IGNORECASE)
_POINT = re.compile(r"\(\s*POINT" + _NUMBERS, re.IGNORECASE)
_SECOND = re.compile(r"\)\s*,\s*ON\s*,\s*2\s*,\s*INTOF", re.IGNORECASE)


@dataclass(slots=True)
class WrittenArc:
    """One arc, numbers as written in the file.

    ``numbers``: centre, vector, radius (NaN = not given). ``sign``: +1 counterclockwise about the
    vector, -1 clockwise, NaN as the dialect says; ``is_free``: the record does not hold the sense.
    ``eighth``: field 8 of a record of 11. ``turns``: turns begun, NX. ``sweep`` [rad] as written,
    NaN else. ``tangent``: start direction that decides the sense; ``towards``: a point in that
    direction. ``end``: point where it ends, if the statement says; ``plane`` i, j, k, d: it ends
    where it meets this plane for the first (``crossing`` 1) or second time.
    """

    numbers: list[float]
    sign: float = NAN
    is_free: bool = False
    eighth: float = NAN
    turns: int = 0
    sweep: float = NAN
    tangent: list[float] | None = None
    towards: list[float] | None = None
    end: list[float] | None = None
    plane: list[float] | None = None
    crossing: int = 1


def numbers_of(
    at: AtLine, statement: Statement, args: tuple[str, ...], blanks: bool = False
) -> list[float]:
    """Return the numbers of a motion statement; ``blanks``: one may stand for a comma."""
    rest = list(args)
    while rest and not rest[-1]:
        rest.pop()
        at.fix("APT020", "empty field at the end", "it is left out")
    if any(" " in arg for arg in rest):
        if not blanks:
            at.fix("APT021", "two numbers without a comma between them", "the blank separates them")
        rest = [part for arg in rest for part in arg.split()]
    values = []
    for arg in rest:
        value = bounded(arg)
        if value is None:
            text = f"{statement.word} has {arg[:20]!r} where a number of at most 1e9 was expected"
            raise at.error("APT022", text)
        values.append(value)
    return values


def circle(at: AtLine, statement: Statement, blanks: bool) -> WrittenArc:
    """Return the arc of CIRCLE/: centre, vector, perhaps radius, sense, TIMES or five more."""
    words = statement.upper
    turns, words = _turns(at, words)
    sign = _SENSES.get(words[-1], NAN) if words else NAN
    words = words if isnan(sign) else words[:-1]
    values = numbers_of(at, statement, words, blanks)
    if len(values) < 6:
        text = (
            f"{statement.word} has {len(values)} numbers, expected centre, vector and perhaps "
            "radius"
        )
        raise at.error("APT032", text)
    eighth = values[_SWEEP_FIELD] if len(values) >= _ELEVEN else NAN
    return WrittenArc([*values, NAN][:7], sign, eighth=eighth, turns=turns)


def _turns(at: AtLine, words: tuple[str, ...]) -> tuple[int, tuple[str, ...]]:
    """Return the number behind TIMES and the words before it."""
    if "TIMES" not in words:
        return 0, words
    place = words.index("TIMES")
    count = bounded(words[place + 1]) if place + 1 < len(words) else None
    if count is None or count != int(count) or not 0 <= count <= _MOST_TURNS:
        raise at.error("APT031", "TIMES needs a whole number of turns")
    return int(count), words[:place]


def arc_with_end(at: AtLine, statement: Statement) -> WrittenArc:
    """Return the arc of ARC/: as CIRCLE, then the end point."""
    values = numbers_of(at, statement, statement.args)
    if len(values) not in (10, 14):
        text = f"ARC has {len(values)} numbers, expected those of a CIRCLE and the end point"
        raise at.error("APT032", text)
    eighth = values[_SWEEP_FIELD] if len(values) == 14 else NAN
    return WrittenArc(values[:7], eighth=eighth, end=values[-3:])


def movarc(at: AtLine, statement: Statement) -> WrittenArc:
    """Return the arc of MOVARC/: c, n, r, ANGLE, degrees, or CENTER, c, AXIS, n, RADIUS, r."""
    words = statement.upper
    if words[:1] == ("CENTER",):
        order = (words[0:1], words[4:5], words[8:9])
        if order == (("CENTER",), ("AXIS",), ("RADIUS",)) and len(words) == 10:
            picked = (*words[1:4], *words[5:8], words[9])
            return WrittenArc(numbers_of(at, statement, picked), 1.0)
        raise _bad_movarc(at)
    if "ANGLE" in words:
        words = tuple(word for word in words if word != "ANGLE")
        if statement.upper.index("ANGLE") != 7:
            raise _bad_movarc(at)
    values = numbers_of(at, statement, words)
    if len(values) != 8 or not abs(values[7]) <= 360.0 * _MOST_TURNS:
        raise _bad_movarc(at)
    return WrittenArc(values[:7], 1.0, is_free=True, sweep=radians(values[7]))


def _bad_movarc(at: AtLine) -> Exception:
    text = (
        "MOVARC needs centre, vector, radius, ANGLE, degrees, "
        "or CENTER, x,y,z, AXIS, i,j,k, RADIUS, r"
    )
    return at.error("APT084", text)


def tool_on(
    at: AtLine, statement: Statement, tangent: list[float] | None, towards: list[float] | None
) -> WrittenArc:
    """Return the arc of TLON,GOFWD/: on a circle or cylinder up to a line, a point or a plane.

    ``tangent``: start direction that INDIRV gave; ``towards``: point that INDIRP gave.
    """
    text = statement.text
    if tangent is None and towards is None:
        raise at.error("APT034", "TLON without INDIRV or INDIRP before it: no start direction")
    found = _on_plane(text) or _on_cylinder(text) or _on_line(text)
    if _TLON.match(text) is None or found is None:
        message = (
            "TLON is read as an arc only: (CIRCLE/x,y,z,r),ON,(LINE/x,y,z,x,y,z), "
            "(CYLNDR/x,y,z,i,j,k,r),ON,(PLANE/PERPTO,..,(POINT/x,y,z)) "
            "or (CIRCLE/CANON,x,y,z,i,j,k,r),ON,(PLANE/i,j,k,d)"
        )
        raise at.error("APT033", message)
    found.tangent, found.towards = tangent, towards
    return found


def _group(pattern: re.Pattern[str], text: str, *counts: int) -> list[float] | None:
    """Return the numbers of the last match of a pattern, None unless they are so many."""
    matches = pattern.findall(text)
    values = [bounded(part) for part in matches[-1].split(",")] if matches else []
    numbers = [value for value in values if value is not None]
    return numbers if len(values) == len(numbers) and len(numbers) in counts else None


def _on_plane(text: str) -> WrittenArc | None:
    """Return NCL's arc; it ends in a plane."""
    circle, plane = _group(_CANON, text, 7), _group(_PLANE, text, 4)
    if circle is None or plane is None:
        return None
    crossing = 2 if _SECOND.search(text) else 1
    return WrittenArc(circle, 1.0, plane=plane, crossing=crossing)


def _on_cylinder(text: str) -> WrittenArc | None:
    """Return CATIA's arc in any plane; the last point of the plane across is its end."""
    cylinder, end = _group(_CYLINDER, text, 7), _group(_POINT, text, 3)
    if cylinder is None or end is None:
        return None
    return WrittenArc(cylinder, 1.0, end=end)


def _on_line(text: str) -> WrittenArc | None:
    """Return CATIA's arc in the xy plane; the second point of the line is its end."""
    circle, ray = _group(_CIRCLE, text, 4), _group(_LINE, text, 4, 6)
    if circle is None or ray is None:
        return None
    end = ray[3:6] if len(ray) == 6 else [*ray[2:4], circle[2]]
    return WrittenArc([*circle[:3], 0.0, 0.0, 1.0, circle[3]], 1.0, end=end)
