"""Random statements at random places of good programs: all that stands in a cut is told."""

import random
from itertools import pairwise
from pathlib import Path

import pytest

from postproc.api import load_cell, read
from postproc.krl import Call, Enum, Move, parse_files
from postproc.verification import verify

FIXTURES = Path(__file__).parents[2] / "fixtures"
CASES = (
    ("trim_5axis", "trim", "trim.cls", False),
    ("wall_tilt", "wall", "wall.apt", False),
    ("peck_cycles", "holes", "holes.clsf", True),
)


def statement(rng):
    """Return one statement that no CAM file asks for in a cut: of every kind, with any numbers."""
    number, port, share = rng.randint(1, 200), rng.randint(1, 4096), round(rng.uniform(1, 90), 3)
    state = rng.choice(("TRUE", "FALSE"))
    call = rng.choice(
        ("PP_SPINDLE_OFF()", "PP_COOLANT_OFF()", f"PP_COOLANT_ON({rng.randint(1, 8)})")
    )
    call = rng.choice((call, f"PP_SPINDLE_ON({port})", "PP_STOP()", f"$OUT[{port}]={state}"))
    kinds = (
        call,
        "PP_SPINDLE_OFF()\r\nPP_SPINDLE_ON(12000)",
        f"TRIGGER WHEN DISTANCE={rng.randint(0, 1)} DELAY={rng.randint(-50, 50)} DO {call}",
        f"INTERRUPT DECL {number} WHEN $IN[{port}]=={state} DO {call}\r\nINTERRUPT ON {number}",
        "CONTINUE",
        f"CONTINUE\r\n{call}",
        f"WAIT SEC {round(rng.uniform(0.1, 9), 2)}",
        f"WAIT FOR $IN[{port}]=={state}",
        "HALT",
        f"PULSE($OUT[{port}],{state},0.5)",
        f"$FLAG[{number}]={state}",
        f"$ANOUT[{rng.randint(1, 32)}]={round(rng.uniform(-1, 1), 3)}",
        "LIN $POS_ACT",
        "PTP $AXIS_ACT",
        f"IF $IN[{port}] THEN\r\nENDIF",
        f"BAS(#ACC_CP,{share})",
        f"BAS(#ACC_PTP,{share})",
        f"$ACC.CP={share}",
        f"$VEL.ORI{rng.randint(1, 2)}={share}",
        f"$ACC.ORI{rng.randint(1, 2)}={share}",
        f"$ACC_AXIS[{rng.randint(1, 6)}]={rng.randint(1, 99)}",
        f"$APO.CVEL={rng.randint(1, 99)}",
        f"$APO.CORI={rng.randint(6, 90)}",
        f"$ADVANCE={rng.choice((0, 1, 2, 4, 5))}",
        f"G_STATE={number}",
        f"ANOUT ON A1={round(rng.uniform(-1, 1), 2)}",
    )
    return rng.choice(kinds)


class Program:
    """A good program of a fixture, and the lines between two motions of one cut."""

    def __init__(self, case, name, cam, drills):
        self.cell = load_cell(FIXTURES / case / "cell.toml")
        self.asked = read(FIXTURES / case / cam, self.cell)
        folder = FIXTURES / case / "expected"
        self.files = {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
        self.name, self.drills = name, drills

    def kinds(self, files=None):
        modules = parse_files(files or self.files)
        report = verify(modules, self.name, self.cell, self.asked, collisions=False)
        return {finding.code for finding in report.violations}

    def places(self):
        """Yield (file, line) behind which a statement stands in a cut: read from the text alone.

        Behind a path motion at a working feed, before another one or the way out of a hole.
        """
        for module in parse_files(self.files):
            speed, cuts = 0.0, []
            for item in (item for routine in module.routines for item in routine.statements):
                if getattr(item, "target", None) == "$VEL.CP":
                    speed = item.value
                elif isinstance(item, Call) and item.arguments[:1] == (Enum("CP_PARAMS"),):
                    speed = item.arguments[1]
                elif isinstance(item, Move):
                    on_path = not item.word.is_axis_motion
                    cuts.append((item.line, on_path, on_path and speed < 0.1))
            for (line, _, here), (_, on_path, after) in pairwise(cuts[:-1]):  # the last leads out
                if here and (after or (self.drills and on_path)):
                    yield Path(module.src_path).name, line

    def put(self, place, text):
        file, line = place
        lines = self.files[file].decode("ascii").split("\r\n")
        lines.insert(line, text)
        return {**self.files, file: "\r\n".join(lines).encode("ascii")}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case[0])
def test_whatever_stands_in_a_cut_is_told(case):
    program, rng = Program(*case), random.Random(43)
    assert program.kinds() == set()
    places = list(program.places())
    missed = []
    for _ in range(40):
        place, text = rng.choice(places), statement(rng)
        try:
            if not program.kinds(program.put(place, text)):
                missed.append((place, text))
        except ValueError as error:
            missed.append((place, text, str(error)))
    assert missed == []
