"""Arcs of every seat against closed forms, from the CAM file to the text of the program.

The text is read by patterns of its own: start, auxiliary and end point of each CIRC give its
circle, and a helix is checked point by point.
"""

import numpy as np
import pytest

from tests.jobs.emitted import converted, steps

HEADS = {
    "fusion": "PARTNO/'x'\nUNITS/MM\nMODE/MILL\n",
    "hsmworks": "UNITS/MM\nLOADTL/1, IN, 0, LENGTH, 60, OSETNO, 1\n",
    "mfgsuite": "UNITS/MM\nOPNAME/'a'\n",
    "nx": "TOOL PATH/A,TOOL,T\nMSYS/0,0,0,1,0,0,0,1,0\n",
}
RADIUS = 20.0
CENTRE = np.array([10.0, -15.0, 40.0])
PLANES = {"xy": (0, 0, 1), "yz": (1, 0, 0), "tilted": (0.6, 0, 0.8)}
SEATS = (
    "fusion", "hsmworks", "mfgsuite", "camplete", "manusnc", "postworks", "catia", "nx",
    "solidworks", "creo", "camworks", "surfcam", "apt",
)  # fmt: skip
SHAPES = [("xy", 180), ("xy", 360), ("xy", 270), ("tilted", 270), ("yz", 180), ("yz", 75)]


HARDEST = {
    **dict.fromkeys(SEATS, ("tilted", 270)),
    "camworks": ("xy", 270),
    "mfgsuite": ("yz", 75),
    "postworks": ("tilted", 270),
    "catia": ("yz", 75),
}
"""CAMWorks knows one plane, MfgSuite the principal ones; of every form one whose end tells most."""
CASES = [
    *((seat, *shape, sense) for seat, shape in HARDEST.items() for sense in (1, -1)),
    *(("fusion", *shape, sense) for shape in SHAPES for sense in (1, -1)),
    *((seat, "xy", 180, 1) for seat in ("nx", "camplete", "mfgsuite", "apt", "catia")),
    *((seat, "xy", 360, -1) for seat in ("nx", "camworks", "solidworks")),
]
"""A form of a record is read alike in all planes: every seat once, every shape in one of them."""


def numbers(values):
    return ",".join(f"{float(value):.6f}" for value in np.ravel(values))


def circle(plane):
    """Return a function of an angle [deg] and a rise [mm] to a point, ccw about the plane."""
    n = np.array(PLANES[plane], dtype=float)
    u = np.cross(n, [0.36, 0.48, 0.8])
    u /= np.linalg.norm(u)

    def at(degrees, rise=0.0):
        a = np.radians(degrees)
        return CENTRE + RADIUS * (np.cos(a) * u + np.sin(a) * np.cross(n, u)) + rise * n

    return n, at


def written(seat, n, at, sweep, sense, rise):
    """Return the record of the arc in the seat's own form, with its end point."""
    end = at(sense * sweep, rise)
    goto = f"GOTO/{numbers(end)}\n"
    about, tangent = sense * n, sense * np.cross(n, at(0) - CENTRE) / RADIUS
    centre = numbers(CENTRE)
    if seat in ("fusion", "hsmworks"):
        return f"MOVARC/{centre},{numbers(about)},{RADIUS},ANGLE,{sweep}\n{goto}"
    if seat == "mfgsuite":
        slope = f"ARCSLP/ {rise}\n" if rise else ""
        return f"{slope}MOVARC/ CENTER,{centre}, AXIS,{numbers(about)}, RADIUS,{RADIUS}\n{goto}"
    if seat in ("camplete", "manusnc"):
        return f"CIRCLE/{centre},{numbers(-about)},{RADIUS},{sweep},0.0,0.0,0.0\n{goto}"
    if seat == "nx":
        return f"CIRCLE/{centre},{numbers(-about)},{RADIUS},0.06,0.5,10.0,0.0\n{goto}"
    if seat == "camworks":
        way = "COUNTERCLOCKWISE" if sense > 0 else "CLOCKWISE"
        return f"CIRCLE/{centre},{numbers(n)},{RADIUS},{way}\n{goto}"
    leave = sense * np.cross(n, end - CENTRE) / RADIUS
    if seat == "postworks":
        which = "ON,2,INTOF" if sweep > 180 else "ON"
        return (
            f"INDIRP/{numbers(at(0) + tangent)}\nTLON,GOFWD/(CIRCLE/CANON,{centre},{numbers(n)},"
            f"{RADIUS}),{which},(PLANE/{numbers([*leave, leave @ CENTRE])})\n"
        )
    if seat == "catia":
        which = "ON,2,INTOF" if sweep > 180 else "ON"
        across = f"PERPTO,(VECTOR/{numbers(n)})"
        return (
            f"PSIS/(PLANE/(POINT/{centre}),{across})\nINDIRV/{numbers(tangent)}\n"
            f"TLON,GOFWD/ (CYLNDR/{centre},$\n{numbers(n)},{RADIUS}),{which},(PLANE/PERPTO,"
            f"(PLANE/(POINT/{centre}),{across}),$\n(POINT/{centre}),(POINT/{numbers(end)}))\n"
        )
    radius = "" if seat == "solidworks" else f",{RADIUS}"
    return f"CIRCLE/{centre},{numbers(about)}{radius}\n{goto}"


def job_of(folder, seat, plane, sweep, sense, rise=0.0):
    n, at = circle(plane)
    tangent = sense * np.cross(n, at(0) - CENTRE) / RADIUS
    end = at(sense * sweep, rise)
    out = sense * np.cross(n, at(sense * sweep) - CENTRE) / RADIUS
    text = (
        f"{HEADS.get(seat, 'UNITS/MM')}\nRAPID\nGOTO/{numbers(at(0) - 30 * tangent)},0,0,1\n"
        f"FEDRAT/600,MMPM\nGOTO/{numbers(at(0))}\n{written(seat, n, at, sweep, sense, rise)}"
        f"GOTO/{numbers(end + 10 * out)}\n{'END-OF-PATH' if seat == 'nx' else 'FINI'}\n"
    ).replace("\n\n", "\n")
    return converted(folder, text, dialect=seat), n, at


def turned(start, through, end, n):
    """Return the way round [deg] about ``n`` from a start over a point to an end."""
    u = (start - CENTRE) / np.linalg.norm(start - CENTRE)
    v = np.cross(n, u)
    on, last = (np.arctan2((p - CENTRE) @ v, (p - CENTRE) @ u) for p in (through, end))
    on, last = np.degrees(on) % 360.0, np.degrees(last) % 360.0
    last = 360.0 if last < 1e-3 else last
    return last if on < last else last - 360.0


def off_the_circle(folder, seat, plane, sweep, sense):
    """Return how far [mm] the text is off the circle of the file, and its way round [deg]."""
    job, n, at = job_of(folder, seat, plane, sweep, sense)
    before, way, off, last = None, 0.0, [], np.full(3, np.inf)
    for step in steps(job):
        if step.word == "CIRC":
            for point in (before, step.aux, step.point):
                off += [np.linalg.norm(point - CENTRE) - RADIUS, (point - CENTRE) @ n]
            way += turned(before, step.aux, step.point, n)
            last = step.point
        before = step.point if step.point is not None else before
    return np.abs([*off, *(last - at(sense * sweep))]).max(), way


@pytest.mark.slow
def test_an_arc_of_the_text_is_the_circle_of_the_file(tmp_path):
    found = {case: off_the_circle(tmp_path, *case) for case in dict.fromkeys(CASES)}
    wrong = {
        case: (off, way)
        for case, (off, way) in found.items()
        if not (off < 2e-4 and way == pytest.approx(case[2] * case[3], abs=2e-3))
    }
    assert wrong == {}


HELICES = (
    ("fusion", 1, 6.0), ("fusion", -1, -3.0), ("hsmworks", -1, 6.0), ("mfgsuite", 1, -3.0),
    ("mfgsuite", -1, 6.0), ("camplete", -1, -3.0), ("manusnc", 1, 6.0), ("nx", -1, 6.0),
)  # fmt: skip


@pytest.mark.parametrize(("seat", "sense", "rise"), HELICES)
def test_a_helix_of_the_text_rises_evenly(tmp_path, seat, sense, rise):
    sweep = 270.0
    job, n, at = job_of(tmp_path, seat, "xy", sweep, sense, rise)
    points = [step.point for step in steps(job) if step.word == "LIN"]
    points = points[[np.linalg.norm(p - at(0)) < 1e-3 for p in points].index(True) : -2]
    assert len(points) > 20
    u = (at(0) - CENTRE) / RADIUS
    v = np.cross(n, u)
    angle = np.degrees(np.unwrap([np.arctan2((p - CENTRE) @ v, (p - CENTRE) @ u) for p in points]))
    assert angle[-1] == pytest.approx(sense * sweep, abs=1e-2)
    for point, a in zip(points, angle, strict=True):
        assert np.linalg.norm(point - at(a, rise * a / (sense * sweep))) < 5e-4
    chord = np.abs(np.diff(angle)).max()
    assert RADIUS * (1.0 - np.cos(np.radians(chord) / 2.0)) < 0.011


@pytest.mark.parametrize("sweep", [180, 270])
def test_a_negative_angle_turns_the_other_way(tmp_path, sweep):
    """A HSM file whose sense stands in the sign of the angle, not in the vector."""
    n, at = circle("xy")
    text = (
        f"{HEADS['fusion']}RAPID\nGOTO/{numbers(at(0) + np.array([9, 0, 9]))}\nFEDRAT/600,MMPM\n"
        f"GOTO/{numbers(at(0))}\nMOVARC/{numbers(CENTRE)},0,0,1,{RADIUS},ANGLE,{-sweep}\n"
        f"GOTO/{numbers(at(-sweep))}\nFINI\n"
    )
    way, before = 0.0, None
    for step in steps(converted(tmp_path, text, dialect="fusion")):
        if step.word == "CIRC":
            way += turned(before, step.aux, step.point, n)
        before = step.point if step.point is not None else before
    assert way == pytest.approx(-sweep, abs=2e-3)
