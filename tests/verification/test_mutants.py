"""Programs of our own, broken in one place each: lint or verify must notice every one.

``by`` names who notices: the code of an error of lint, or the kind of a violation of verify.
"""

import re

import pytest

from postproc.errors import KrlError, Severity
from postproc.krl.lint import lint
from postproc.krl.text.parse import parse_files
from postproc.verification.verify import verify


def noticed(files, cell, toolpath):
    """Codes of errors of lint and kinds of violations of verify."""
    try:
        modules = parse_files(files)
    except KrlError as error:
        return {error.code}
    found = {i.code for i in lint(modules) if i.severity is Severity.ERROR}
    try:
        report = verify(modules, modules[0].name, cell, toolpath, collisions=False)
    except KrlError as error:
        return found | {error.code}
    return found | {violation.code for violation in report.violations}


class Text:
    """The lines of a program, to be broken."""

    def __init__(self, files):
        self.files = dict(files)
        self.name = next(iter(files))
        self.lines = files[self.name].decode("ascii").split("\r\n")

    def at(self, pattern, number=0):
        """Index of the line that matches, the ``number``-th one."""
        found = [i for i, line in enumerate(self.lines) if re.search(pattern, line)]
        return found[number]

    def sub(self, pattern, new, number=0, inside=None):
        """Replace in the line that matches ``pattern`` (the passage ``inside``)."""
        at = self.at(pattern, number)
        changed = re.sub(inside or pattern, new, self.lines[at], count=1)
        assert changed != self.lines[at], "the mutant changes nothing"
        self.lines[at] = changed
        return self

    def every(self, pattern, new):
        """Replace in all lines that match: a change of tool selects the frames again."""
        self.lines = [re.sub(pattern, new, line) for line in self.lines]
        return self

    def drop(self, pattern, number=0, count=1):
        at = self.at(pattern, number)
        del self.lines[at : at + count]
        return self

    def add(self, pattern, line, number=0, before=False):
        at = self.at(pattern, number)
        self.lines.insert(at if before else at + 1, line)
        return self

    def swap(self, pattern, one, other):
        i, j = self.at(pattern, one), self.at(pattern, other)
        self.lines[i], self.lines[j] = self.lines[j], self.lines[i]
        return self

    def done(self):
        content = "\r\n".join(self.lines).encode("utf-8")
        return {**self.files, self.name: content}


CUT = r"^LIN .*CAM line (9|10|11)$"
HOLE = r"^LIN \{X 8\.0000"
PECK = r"^LIN \{X 12\.0000"
MUTANTS = {
    # --- points
    "a point moved by 0.05 mm": (
        lambda t: t.sub(r"CAM line 10", "X 0.0500", 0, r"X 0\.0000"),
        "position",
    ),
    "a point moved by 100 mm": (
        lambda t: t.sub(r"CAM line 10", "Y -200.0", 0, r"Y -100\.0000"),
        "position",
    ),
    "wrong decimal": (lambda t: t.sub(r"CAM line 11", "Z 26.0000", 0, r"Z 260\.0000"), "position"),
    "a point missing": (lambda t: t.drop(r"CAM line 10"), "position"),
    "two points swapped": (lambda t: t.swap(r"^LIN.*CAM line 1[01]$", 0, 1), "order"),
    "two holes swapped": (lambda t: t.swap(HOLE, 1, 2), "order"),
    "a hole missing": (lambda t: t.drop(HOLE, 1), "depth"),
    "last point missing": (lambda t: t.drop(r"CAM line 20"), "position"),
    "a detour between two points": (
        lambda t: t.add(r"CAM line 10", "LIN {X 0.0,Y -120.0,Z 230.0,A 0.0,B 0.0,C -69.2}"),
        "path",
    ),
    "a cut made by PTP": (lambda t: t.sub(r"CAM line 17", "PTP", 0, r"^LIN"), "path"),
    "arc the other way round": (
        lambda t: t.sub(r"^CIRC", "Y -105.8579", 0, r"Y -94\.1421"),
        "path",
    ),
    "an arc missing": (lambda t: t.drop(r"^CIRC"), "position"),
    "arc as a chord": (
        lambda t: t.sub(r"^CIRC", "LIN {", 0, r"CIRC \{[^}]*\},\{"),
        "path",
    ),
    "auxiliary point on the line": (
        lambda t: t.sub(r"^CIRC", "Y -90.0000,Z 270.0000", 0, r"Y -94\.1421,Z 274\.1421"),
        "KRL124",
    ),
    # --- orientation, frames, axes
    "tool axis tilted by 0.1 deg": (
        lambda t: t.sub(r"CAM line 10", "B 0.10000", 0, r"B 0\.00000"),
        "axis",
    ),
    "angles in another order": (
        lambda t: t.sub(r"^LIN .*line 10", r"A \3,B \2,C \1", 0, r"A (\S+),B (\S+),C ([-\d.]+)"),
        "axis",
    ),
    "wrong tool number": (lambda t: t.every(r"BAS\(#TOOL,1\)", "BAS(#TOOL,2)"), "frame"),
    "wrong base number": (lambda t: t.every(r"BAS\(#BASE,1\)", "BAS(#BASE,3)"), "frame"),
    "tool number of no controller": (lambda t: t.sub(r"BAS\(#TOOL,1\)", "BAS(#TOOL,99)"), "KRL110"),
    "tool not set": (lambda t: t.every(r"BAS\(#TOOL,1\)", ""), "KRL109"),
    "base not set": (lambda t: t.every(r"BAS\(#BASE,1\)", ""), "frame"),
    "base zero": (lambda t: t.sub(r"BAS\(#BASE,1\)", "BAS(#BASE,0)"), "KRL110"),
    "a tool frame of its own": (
        lambda t: t.every(r"BAS\(#TOOL,1\)", "$TOOL={X 107.0,Y 0.0,Z 360.0,A 0.0,B 0.0,C 0.0}"),
        "frame",
    ),
    "an axis value off": (
        lambda t: t.sub(r"^PTP .*line 7", "A1 -14.30000", 0, r"A1 -15\.\d+"),
        "position",
    ),
    "an axis beyond its limit": (
        lambda t: t.sub(r"^PTP .*line 26", "A5 -150.0", 0, r"A5 -?\d+\.\d+"),
        "joint_limit",
    ),
    "wrong S": (
        lambda t: t.sub(
            r"^PTP .*line 26",
            "PTP {X -30.0,Y 100.0,Z 200.0,A 0.0,B 0.0,C -65.816,S 1,T 0} ;",
            0,
            r"^PTP.*;",
        ),
        "unreachable",
    ),
    "S and T in contradiction": (
        lambda t: t.sub(
            r"^PTP .*line 26",
            "PTP {X -30.0,Y 100.0,Z 200.0,A 0.0,B 0.0,C -65.816,S 6,T 2} ;",
            0,
            r"^PTP.*;",
        ),
        "KRL112",
    ),
    "wrong T": (
        lambda t: t.sub(
            r"^PTP .*line 26",
            "PTP {X -30.0,Y 100.0,Z 200.0,A 0.0,B 0.0,C -65.816,S 2,T 5} ;",
            0,
            r"^PTP.*;",
        ),
        "turn",
    ),
    "an axis left out": (lambda t: t.sub(r"^PTP .*line 7", "", 0, r",A6 [-\d.]+"), "KRL111"),
    "first motion LIN": (
        lambda t: t.sub(
            r"^PTP .*line 7", "LIN {X -60.0,Y -150.0,Z 200.0,A 0.0,B 0.0,C -70.0} ;", 0, r"^PTP.*;"
        ),
        "KRL111",
    ),
    # --- speeds
    "speed zero": (
        lambda t: t.sub(r"VEL\.CP=0\.010000", "$VEL.CP=0.000000", 0, r"\$VEL.CP=[\d.]+"),
        "KRL115",
    ),
    "speed in mm/min": (lambda t: t.sub(r"VEL\.CP=0\.010000", "=600.0", 0, r"=[\d.]+"), "KRL115"),
    "feed with two decimals": (
        lambda t: t.sub(r"VEL\.CP=0\.0025", "=0.00", 0, r"=[\d.]+"),
        "KRL115",
    ),
    "feed one percent off": (
        lambda t: t.sub(r"VEL\.CP=0\.010000", "=0.010100", 0, r"=[\d.]+"),
        "feed",
    ),
    "a feed not set": (lambda t: t.drop(r"VEL\.CP=0\.005"), "feed"),
    "plunge at rapid speed": (lambda t: t.drop(r"VEL\.CP=0\.0025", 1), "feed"),
    "axis speed 150 %": (lambda t: t.sub(r"VEL_PTP,50", "150", 0, r"50"), "KRL116"),
    "axis index 7": (lambda t: t.add(r"VEL_PTP,50", "$VEL_AXIS[7]=50"), "KRL116"),
    # --- drilling
    "a hole 1 mm short": (lambda t: t.sub(HOLE, "X 7.0000", 1, r"X 8\.0000"), "depth"),
    "a hole 1 mm deep": (lambda t: t.sub(PECK, "X 13.0000", 0, r"X 12\.0000"), "depth"),
    "blended plunge": (lambda t: t.sub(HOLE, "} C_DIS ;", 1, r"\} ;"), "blended_plunge"),
    "blended before the plunge": (
        lambda t: t.sub(r"^LIN \{X -3\.0000", "} C_DIS ;", 1, r"\} ;"),
        "blended_plunge",
    ),
    "plunge from the side": (
        lambda t: t.sub(r"^LIN \{X -3\.0000", "Y 131.0000", 1, r"Y 130\.0000"),
        "plunge",
    ),
    "no retract": (lambda t: t.drop(r"^LIN \{X -30\.0000", 2), "retract"),
    "retract too low": (
        lambda t: t.sub(r"^LIN \{X -30\.0000", "X -10.0", 1, r"X -30\.0000"),
        "retract",
    ),
    "lost dwell in a hole": (lambda t: t.drop(r"WAIT SEC 0\.5000", 2), "dwell"),
    "short dwell in a hole": (
        lambda t: t.sub(r"WAIT SEC 0\.5000", "0.0500", 0, r"0\.5000"),
        "dwell",
    ),
    "lost dwell in a cut": (lambda t: t.drop(r"WAIT SEC 1\.5000"), "dwell"),
    # --- process
    "spindle not switched on": (lambda t: t.drop(r"PP_SPINDLE_ON", 1), "event"),
    "spindle not switched off": (lambda t: t.drop(r"PP_SPINDLE_OFF", 1), "event"),
    "wrong spindle speed": (
        lambda t: t.sub(r"PP_SPINDLE_ON\(1200", "PP_SPINDLE_ON(12000"),
        "event",
    ),
    "spindle turns the other way": (
        lambda t: t.sub(r"PP_SPINDLE_ON\(1200", "PP_SPINDLE_ON(-1200"),
        "event",
    ),
    "spindle on after the cut": (
        lambda t: t.drop(r"PP_SPINDLE_ON", 0).add(r"CAM line 18", "PP_SPINDLE_ON(3000)"),
        "event",
    ),
    "stop lost": (lambda t: t.drop(r"PP_STOP"), "event"),
    "coolant lost": (lambda t: t.drop(r"PP_COOLANT_ON"), "event"),
    "wrong tool called": (lambda t: t.sub(r"PP_TOOL_CHANGE\(1", "PP_TOOL_CHANGE(3"), "event"),
    # --- text
    "24 characters exceeded": (
        lambda t: t.sub(r"^DEF demo", "DEF demo567890123456789012345"),
        "KRL104",
    ),
    "routine of another name": (lambda t: t.sub(r"^DEF demo", "DEF demo2"), "KRL103"),
    "a declaration missing": (
        lambda t: t.sub(r"CAM line 10", "LIN XP1 ;", 0, r"^LIN.*;"),
        "KRL105",
    ),
    "a value in a declaration": (lambda t: t.add(r"^DEF demo", "DECL INT n=1"), "KRL106"),
    "decimal comma": (lambda t: t.sub(r"CAM line 10", "X 0,0", 0, r"X 0\.0000"), "KRL101"),
    "nan": (lambda t: t.sub(r"CAM line 10", "X nan", 0, r"X 0\.0000"), "KRL107"),
    "a component twice": (
        lambda t: t.sub(r"CAM line 10", "X -100.0000", 0, r"Y -100\.0000"),
        "KRL107",
    ),
    "no INI": (lambda t: t.drop(r"INITMOV"), "KRL109"),
    "bare INI": (lambda t: t.sub(r"BAS\(#INITMOV,0\)", "INI"), "KRL102"),
    "no END": (lambda t: t.drop(r"^END$"), "KRL102"),
    "cut off in the middle": (lambda t: t.drop(HOLE, 2, 1000), "KRL102"),
    "G-code inside": (lambda t: t.add(r"CAM line 10", "G01 X10 Y20"), "KRL102"),
    "comment of another language": (lambda t: t.add(r"CAM line 10", "// next"), "KRL102"),
    "a letter that is not ASCII": (
        lambda t: t.sub(r"CAM line 10", "WAIT FOR \u00e4", 0, r"^LIN.*"),
        "KRL108",
    ),
    "C_PTP on a LIN": (lambda t: t.sub(r"CAM line 10", "C_PTP", 0, r"C_DIS"), "KRL118"),
    "last motion blended": (
        lambda t: t.sub(r"^LIN \{X -30\.0000", "} C_DIS ;", 5, r"\} ;"),
        "KRL118",
    ),
    "$ADVANCE 9": (lambda t: t.sub(r"ADVANCE=3", "ADVANCE=9"), "KRL117"),
}


def test_the_unbroken_program_is_good(emitted):
    cell, toolpath, files = emitted()
    assert noticed(files, cell, toolpath) == set()


def test_there_are_enough():
    assert len(MUTANTS) >= 40


@pytest.mark.parametrize("name", MUTANTS)
def test_lint_or_verify_notices(emitted, name):
    cell, toolpath, files = emitted()
    mutate, by = MUTANTS[name]
    assert by in noticed(mutate(Text(files)).done(), cell, toolpath)


STYLES = [
    ("dense", "dat", "8.6", 1000),
    ("dense", "inline", "8.6", 15),
    ("spline", "inline", "8.6", 1000),
    ("spline", "dat", "8.5", 15),
    ("spline_block", "inline", "8.6", 1000),
    ("spline_block", "dat", "8.6", 15),
    ("forms", "inline", "8.5", 1000),
    ("forms", "dat", "8.6", 1000),
    ("forms", "dat", "8.5", 15),
]


@pytest.mark.parametrize("style", STYLES, ids=lambda s: "-".join(map(str, s)))
def test_every_style_is_good(emitted, style):
    cell, toolpath, files = emitted(*style)
    modules = parse_files(files)
    assert [i for i in lint(modules) if i.severity is not Severity.NOTE] == []
    report = verify(modules, modules[0].name, cell, toolpath, collisions=False)
    assert report.violations == ()
    assert report.matched == report.tags == len(toolpath)
    assert report.position_error < 0.001e-3


IN_DATA = {
    "a point of the data list moved": (r"^DECL E6POS XP?\w*=", r"X (-?\d+)\.", r"X 9\1."),
    "a point of the data list missing": (r"^DECL E6POS XP?\w*=", r"^.*$", ""),
}


@pytest.mark.parametrize("name", IN_DATA)
@pytest.mark.parametrize("style", [("dense", "dat", "8.6", 1000), ("forms", "dat", "8.5", 1000)])
def test_points_in_the_data_list(emitted, style, name):
    cell, toolpath, files = emitted(*style)
    pattern, inside, new = IN_DATA[name]
    dat = next(key for key in files if key.endswith(".dat") and b"E6POS" in files[key])
    lines = files[dat].decode().split("\r\n")
    at = [i for i, line in enumerate(lines) if re.search(pattern, line)][1]
    lines[at] = re.sub(inside, new, lines[at], count=1)
    assert noticed({**files, dat: "\r\n".join(lines).encode()}, cell, toolpath)


def test_a_lost_sub_program(emitted):
    cell, toolpath, files = emitted("dense", "inline", "8.6", 15)
    lost = {name: text for name, text in files.items() if "_002" not in name}
    assert "position" in noticed(lost, cell, toolpath)


def test_sub_programs_called_in_another_order(emitted):
    cell, toolpath, files = emitted("dense", "inline", "8.6", 15)
    text = Text(files).swap(r"_00[12]\( ?\)", 0, 1)
    assert "order" in noticed(text.done(), cell, toolpath)
