"""Tables as anyone may write them: names, units, separators, order; the truth is in SI here."""

import math
import random

import numpy as np
import pytest

from postproc.errors import ReadError
from postproc.model import EventKind, MotionKind
from postproc.process import stretches
from postproc.readers import read as read_file

DEG = math.pi / 180.0
LENGTHS = {"mm": 1e-3, "m": 1.0, "in": 0.0254, "inch": 0.0254, "cm": 1e-2, "\u00b5m": 1e-6}
SPEEDS = {
    "mm/min": 1e-3 / 60, "mm/s": 1e-3, "m/s": 1.0, "m/min": 1 / 60, "in/min": 0.0254 / 60,
    "mm per min": 1e-3 / 60, "mm_s": 1e-3, "mmpm": 1e-3 / 60, "ipm": 0.0254 / 60,
    "mm min-1": 1e-3 / 60, "inch/s": 0.0254,
}  # fmt: skip
TURNS = {
    "1/min": 1 / 60, "rpm": 1 / 60, "U/min": 1 / 60, "min-1": 1 / 60, "tr/min": 1 / 60, "1/s": 1.0,
    "rev/min": 1 / 60, "Hz": 1.0,
}  # fmt: skip
TIMES = {"s": 1.0, "ms": 1e-3, "sec": 1.0, "min": 60.0}
ANGLES = {"deg": DEG, "rad": 1.0, "\u00b0": DEG}
NAMES = {
    "x": "X|Pos X|x_pos|X-Koordinate|MX Coord.|Point X|Coordonn\u00e9e X",
    "a": "A|KUKA A", "roll": "rx|Roll|RotX",
    "depth": "depth|Tiefe|Bohrtiefe|Hole Depth|Bohrungstiefe|Profondeur|drill depth|DEPTH",
    "feed": "feed|Feed rate|F|Vorschub|Vf|avance|Vitesse d'avance|Vorschub f|FeedRate",
    "pace": "speed|velocity|v|Geschwindigkeit|linear speed",
    "spindle": "spindle|Spindle Speed|Drehzahl|Drehzahl n|Spindeldrehzahl|Vitesse de broche",
    "letter": "S|n|speed",
    "dwell": "dwell|Verweilzeit|Dwell time|Temporisation",
    "peck": "peck|Peck depth|Zustelltiefe",
    "diameter": "Diameter|Dia.|Durchmesser|Bohrungsdurchmesser|\u00d8|D",
    "sense": "sense|Drehrichtung|Spindle direction|Sens de rotation",
    "tool": "tool|Tool No|Werkzeug|T|Outil", "id": "id|Hole|Name|Hole ID|Bohrung|Point",
    "comment": "Comment|Bemerkung|Grip [mm]|Part No.|Remarque|Werkstoff",
}  # fmt: skip
STRANGE = (
    "feed_furlong_s", "offset", "Feed override [%]", "Spindle load", "coolant", "tilt (deg)", "ry2",
    "x [kN]", "Frame", "Nullpunktversatz", "speed factor", "Rotation", "wait", "mirror", "Type",
    "Winkel [\u00b0]", "feed per tooth [mm]", "cutting speed (m/min)", "unit",
    "d\u00e9calage Z (mm)",
    "start speed (mm/s)", "E1 [mm]", "Feed %", "feed*", "i (mm)", "depth=",
    "rapid", "depth2", "angle", "lead_deg",
)  # fmt: skip
SENSES = {1.0: ("CW", "cw", "M3", "CLW", "M03", "rechts"), -1.0: ("CCW", "M4", "cclw", "links")}


class Table:
    """A table drawn at random: ``columns`` (header, texts), and the truth in SI."""

    def __init__(self, seed):
        self.draw = draw = random.Random(seed)
        self.n = n = 5
        self.outspoken = draw.choice((0.0, 0.5, 1.0, 1.0))  # how often a unit is said
        self.columns, self.bare, self.units = [], False, set()
        spot = range(n)
        self.points = np.array([[40 * i, 7.5 * (i % 2), 3.25 * i] for i in spot]) * 1e-3
        tilt = np.array([draw.uniform(-30, 30) for _ in spot]) * DEG
        self.axes = np.column_stack([np.sin(tilt), 0 * tilt, np.cos(tilt)])
        for k, letter in enumerate("xyz"):
            self.add("x", LENGTHS, self.points[:, k], swap=("x", letter))
        if draw.random() < 0.6:
            for k, (point, axis) in enumerate(("xi", "yj", "zk")):
                names = (axis.upper(), f"n{point}", f"Normal {point.upper()}", f"axis_{axis}")
                self.put(draw.choice(names), self.axes[:, k])
        else:  # the tool's axis is x of the TCP: its z axis leans about y
            role = draw.choice(("a", "roll"))
            abc = {"a": "ABC", "roll": ("rz", "ry", "rx")}[role]
            pitch = np.array([math.atan2(z, -x) for x, _, z in self.axes])
            unit = draw.choice([*ANGLES, ""] if role == "a" else list(ANGLES))
            for letter, values in zip(abc, (0 * pitch, pitch, 0 * pitch), strict=True):
                self.put(self.headed(letter, unit), values / ANGLES.get(unit, DEG))
        self.depth = np.array([draw.choice((6.0, 8.0, 12.5)) for _ in spot]) * 1e-3
        self.add("depth", LENGTHS, self.depth)
        self.feed = self.turns = None
        if draw.random() < 0.7:
            self.feed = np.array([draw.choice((60.0, 120.0, 300.0)) for _ in spot]) / 60e3
            self.add("feed" if draw.random() < 0.7 else "pace", SPEEDS, self.feed)
        if draw.random() < 0.7:
            self.turns = np.array([draw.choice((3000.0, 3000.0, 6000.0)) for _ in spot]) / 60
            way = np.array([draw.choice((1.0, -1.0)) for _ in spot])
            signed = draw.random() < 0.5
            role = draw.choice(("spindle", "letter"))
            self.add(role, TURNS, self.turns * (way if signed else 1.0))
            if not signed:
                self.put(self.word("sense"), [draw.choice(SENSES[w]) for w in way])
            self.turns = self.turns * way
        self.dwell = np.array([draw.choice((0.0, 0.5, 2.0)) for _ in spot])
        if draw.random() < 0.3:
            self.add("dwell", TIMES, self.dwell)
        else:
            self.dwell = 0 * self.dwell
        self.peck = np.full(n, 2e-3) if draw.random() < 0.3 else np.zeros(n)
        if self.peck.any():
            self.add("peck", LENGTHS, self.peck)
        if draw.random() < 0.3:
            self.add("diameter", LENGTHS, np.full(n, 6.35e-3))
        if draw.random() < 0.4:
            self.put(self.word("tool"), [str(draw.choice((3, 3, 7))) for _ in spot])
        if draw.random() < 0.7:
            self.put(self.word("id"), [f"H{i}" for i in spot])
        if draw.random() < 0.5:
            self.put(self.word("comment"), ["see_1"] * n)
        draw.shuffle(self.columns)

    def word(self, role):
        return self.draw.choice(NAMES[role].split("|"))

    def headed(self, name, unit):
        """Return a name with its unit in one of the ways people write it."""
        if not unit:
            return name
        form = self.draw.choice(("{} ({})", "{} [{}]", "{} [{}]", "{}_{}", "{} {}", "{} / {}"))
        unit = unit.replace("/", "_") if form == "{}_{}" and unit[0] not in "1" else unit
        whole = form.format(name, unit)
        return whole.upper() if self.draw.random() < 0.1 and "\u00b5" not in whole else whole

    def add(self, role, units, values, swap=None):
        """Add a column of a quantity in a unit of its own, or without one where that is usual."""
        name, bare = self.word(role), next(iter(units))
        if swap:
            name = name.replace("x", swap[1]).replace("X", swap[1].upper())
        needs = role in ("pace",) or (role == "letter" and name == "speed")
        says = needs or self.draw.random() < self.outspoken
        unit = self.draw.choice(list(units)) if says else ""
        if says and not needs and self.outspoken < 1.0 and self.draw.random() < 0.8:
            unit = bare
        if unit or role == "diameter":
            self.units.add(unit)
        elif role not in ("spindle", "letter", "dwell"):
            self.bare = True
        self.put(self.headed(name, unit), values / units[unit or bare])

    def put(self, name, values):
        self.columns.append((name, values))

    def text(self):
        separator = self.draw.choice((",", ";", "\t"))
        comma = separator != "," and self.draw.random() < 0.5

        def field(value):
            if isinstance(value, str):
                return value
            text = f"{value:.12g}" if self.draw.random() < 0.8 else f"{value:.11e}"
            return text.replace(".", ",") if comma else text

        rows = [[name for name, _ in self.columns]]
        rows += [[field(values[i]) for _, values in self.columns] for i in range(self.n)]
        top = self.draw.choice(("", "", "# made by hand\n", f"sep={separator}\n", "// a list\n"))
        end = self.draw.choice(("\n", "\r\n"))
        return (top + "\n".join(separator.join(row) for row in rows) + "\n").replace("\n", end)

    @property
    def may_be_asked(self):
        """Whether a column without a unit stands beside one in another unit than mm."""
        odd = {u for u in self.units if u and (u[:2] in ("in", "ip") or u in LENGTHS) and u != "mm"}
        return self.bare and bool(odd)


def differences(table, path):
    """Yield what a toolpath has otherwise than the table says."""
    close = {"rtol": 1e-8, "atol": 1e-10}
    if not np.allclose(path.points, table.points, **close):
        yield "points"
    if not np.allclose(path.axes, table.axes, atol=1e-8):
        yield "axes"
    if not (path.kind == MotionKind.HOLE).all():
        yield "kind"
        return
    cycles = [path.cycles[i] for i in path.cycle]
    for name in ("depth", "dwell", "peck"):
        if not np.allclose([getattr(c, name) for c in cycles], getattr(table, name), **close):
            yield name
    if not np.allclose(path.feed, np.nan if table.feed is None else table.feed, equal_nan=True):
        yield "feed"
    turns = np.full(table.n, np.nan)
    for part in stretches(path.events, table.n):
        turns[part.first : part.stop] = part.turns
    truth = np.full(table.n, np.nan) if table.turns is None else table.turns
    if not np.allclose(turns, truth, equal_nan=True):
        yield "spindle"


def test_any_spelling_unit_and_order_is_the_same_toolpath_or_asked_back(read_text):
    wrong, read = [], 0
    for seed in range(400):
        table = Table(seed)
        text = table.text()
        try:
            path = read_text(text.encode("utf-8"), "t.csv")
        except ReadError as problem:
            named = any(name.strip() in str(problem) for name, _ in table.columns)
            if not (table.may_be_asked and problem.code == "CSV016" and named):
                wrong.append((seed, str(problem), text.splitlines()[:3]))
            continue
        read += 1
        wrong += [(seed, what, text.splitlines()[:4]) for what in differences(table, path)]
    assert not wrong, f"{len(wrong)}: {wrong[:4]}"
    assert read > 200


def test_a_column_that_is_not_understood_stops_by_its_name(read_text):
    wrong = []
    for seed, strange in enumerate(STRANGE):
        table = Table(1000 + seed)
        while table.may_be_asked:
            table = Table(table.draw.randrange(10**6))
        table.put(strange, ["1.5"] * table.n)
        table.draw.shuffle(table.columns)
        text = table.text().encode("utf-8")
        try:
            read_text(text, "t.csv")
            wrong.append((strange, "read"))
        except ReadError as problem:
            if problem.code != "CSV016" or strange not in str(problem):
                wrong.append((strange, str(problem)))
        accepted = read_text(text, "t.csv", accept_words=(strange,))
        wrong += [(strange, what) for what in differences(table, accepted)]
        if not any(use.word == strange and not use.refused for use in accepted.word_uses):
            wrong.append((strange, "accepted without a word"))
        looked = read_text(text, "t.csv", points_only=True)
        if not any(use.word == strange and use.refused for use in looked.word_uses):
            wrong.append((strange, "not listed"))
    assert not wrong, wrong


@pytest.mark.parametrize(
    ("header", "row", "named"),
    [
        ("x,y,z,rx,ry,rz,depth", "0,0,0,0.3,0,0,12", "rx"),
        ("x,y,z,roll,pitch,yaw", "0,0,0,0.3,0,0", "roll"),
        ("x,y,z,rx_deg,ry,rz", "0,0,0,0.3,0,0", "ry"),
        ("x,y,z,i,j,k,speed", "0,0,0,0,0,1,50", "speed"),
        ("x,y,z,i,j,k,velocity", "0,0,0,0,0,1,50", "velocity"),
        ("x,y,z,i,j,k,depth,n", "0,0,0,0,0,1,5,3", "n"),
        ("x,y,z,i,j,k,depth,S", "0,0,0,0,0,1,5,0", "S"),
        ("x,y,z,i,j,k,depth,spindle", "0,0,0,0,0,1,5,1", "spindle"),
        ("x,y,z,i,j,k,r", "0,0,0,0,0,1,30", "column r "),
        ("x,y,z,i,j,k,depth,sense", "0,0,0,0,0,1,5,CW", "sense"),
        ("x,y,z,i,j,k,depth,feed (mm/rev)", "0,0,0,0,0,1,5,0.1", "mm/rev"),
        ("x [in],y [in],z [in],i,j,k,depth", "0,0,0,0,0,1,0.5", "depth"),
        ("x,y,z,i,j,k,depth,feed ipm", "0,0,0,0,0,1,5,4", "column x "),
        ("x,y,z,i,j,k,depth,", "0,0,0,0,0,1,5,7", "column 8"),
    ],
)
def test_what_has_two_meanings_is_asked_back(header, row, named, read_text):
    with pytest.raises(ReadError, match="CSV016") as caught:
        read_text(f"{header}\n{row}\n", "t.csv")
    assert named in str(caught.value)
    assert "--columns" in caught.value.hint


@pytest.mark.parametrize(
    ("rows", "refused"),
    [
        ("0,0,0,0,0,1,0.012\n0.12,0,0,0,0,1,0.012\n", True),
        ("0,0,0,0,0,1,12\n0.5,0,0,0,0,1,12\n", True),
        ("0,0,0,0,0,1,0.012\n120,0,0,0,0,1,0.012\n", True),
        ("0,0,0,0,0,1,12\n", False),
        ("0,0,0,0,0,1,0\n120,0,0,0,0,1,12\n", False),
    ],
)
def test_metres_without_a_unit_are_asked_back(rows, refused, read_text):
    text = "x,y,z,i,j,k,depth\n" + rows
    if refused:
        with pytest.raises(ReadError, match="CSV017"):
            read_text(text, "t.csv")
        assert read_text(text, "t.csv", units="m").units == "m"
    path = read_text(text, "t.csv", points_only=True)
    assert "lengths in mm" in path.assumed


@pytest.mark.parametrize(
    ("header", "rows", "unit"),
    [
        ("a,b,c,feed", ["0,1.5708,0,600", "3.14159,0,0,600"], "a_rad,b_rad,c_rad,feed"),
        ("i,j,k,feed", ["0,0,1,0.01", "0,0,1,0.05"], "i,j,k,feed_m_s"),
        ("i,j,k,depth,dwell", ["0,0,1,5,500", "0,0,1,5,0"], "i,j,k,depth,dwell_ms"),
    ],
)
def test_numbers_that_refute_the_usual_unit_are_asked_back(header, rows, unit, read_text):
    text = f"x,y,z,{header}\n" + "".join(f"{40 * i},0,0,{row}\n" for i, row in enumerate(rows))
    with pytest.raises(ReadError, match="CSV017"):
        read_text(text, "t.csv")
    read_text(text, "t.csv", columns=f"x,y,z,{unit}")


def test_a_coordinate_in_an_unknown_unit_is_listed_and_never_lost(read_text):
    text = "x [kN],y,z,i,j,k\n1,2,3,0,0,1\n"
    with pytest.raises(ReadError, match="CSV016"):
        read_text(text, "t.csv")
    looked = read_text(text, "t.csv", points_only=True)
    assert [use.word for use in looked.word_uses] == ["x [kN]"]


def test_rows_of_one_name_with_other_work_are_no_repeated_measurements(read_text):
    text = "id,x,y,z,i,j,k,depth\nA,1,2,3,0,0,1,5\nA,1,2,3,0,0,1,12\n"
    assert len(read_text(text, "t.csv")) == 2


def test_the_spindle_follows_the_rows(read_text):
    text = "x,y,z,i,j,k,depth,rpm,tool\n" + "".join(
        f"{20 * i},0,0,0,0,1,5,{rpm},{tool}\n"
        for i, (rpm, tool) in enumerate([("3000", 1), ("", 1), ("-600", 1), ("0", 1), ("600", 2)])
    )
    events = [(e.index, e.kind, round(e.value * 60)) for e in read_text(text, "t.csv").events]
    on, off, change = EventKind.SPINDLE_ON, EventKind.SPINDLE_OFF, EventKind.TOOL_CHANGE
    assert events == [
        (0, change, 60), (0, on, 3000), (2, on, -600), (3, off, 0), (4, change, 120), (4, on, 600),
    ]  # fmt: skip


def test_a_feed_per_turn_takes_the_speed_of_its_row(read_text):
    text = "x,y,z,i,j,k,depth,feed (mm/U),rpm\n0,0,0,0,0,1,5,0.1,3000\n9,0,0,0,0,1,5,0.1,-600\n"
    np.testing.assert_allclose(read_text(text, "t.csv").feed, [5e-3, 1e-3])


ROW = "10,20,30,0,0,1\n"
HEADERS = {
    "X-Achse,Y-Achse,Z-Achse,i,j,k\n": 1e-3,
    "Nominal X,Nominal Y,Nominal Z,I,J,K\n": 1e-3,
    "Soll X,Soll Y,Soll Z,NX,NY,NZ\n": 1e-3,
    "x,y,z,i,j,k\nmm,mm,mm,,,\n": 1e-3,
    "x,y,z,i,j,k\n[mm],[mm],[mm],-,-,-\n": 1e-3,
    "X,Y,Z,i,j,k\ninch,inch,inch,,,\n": 25.4e-3,
    "X,Y,Z,i,j,k\n(cm),(cm),(cm),,,\n": 1e-2,
}


def test_units_below_the_header_and_other_words_for_a_coordinate(tmp_path):
    wrong = []
    for header, factor in HEADERS.items():
        path = tmp_path / "points.csv"
        path.write_text(header + ROW + ROW.replace("10,20", "110,20"))
        toolpath = read_file(str(path))
        first = np.array([10.0, 20.0, 30.0]) * factor
        if len(toolpath) != 2 or not np.allclose(toolpath.points[0], first):
            wrong.append((header, toolpath.points))
    assert not wrong
