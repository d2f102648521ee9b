"""Every number of every input: what is none, or absurd, is one clear line at its place, at once.

Each number of a sample is replaced in turn; the samples hold every kind of number that its format
has. A new reader of numbers belongs into ``INPUTS``.
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, field
from pathlib import Path

import click
import pytest

from postproc.cli import app
from postproc.readers import READERS
from tests.places import FIXTURES
from tests.samples import APT_TEXT, CELL_TEXT

ENDLESS = 20.0
"""A number that costs more processor time [s] has no bound (the usual is 0.1)."""
WORDS = ("nan", "inf", "-inf", "1e999", "1e308", "1_0", "0x1F")
URDF = """<robot name="arm">
{links}
<joint name="j1" type="revolute">
<parent link="b"/><child link="l1"/><origin xyz="0.1 0 0.6" rpy="0 0.1 0"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="2" effort="9"/>
</joint>
{joints}
</robot>
"""
LINK = """<link name="l1"><inertial><mass value="90"/>
<inertia ixx="1" ixy="0.1" ixz="0.1" iyy="1" iyz="0.1" izz="1"/></inertial>
<collision><origin xyz="0 0 0.1"/><geometry>
<cylinder radius="0.1" length="0.2"/>
</geometry></collision></link>
"""
JOINT = (
    '<joint name="j{0}" type="revolute"><parent link="l{1}"/><child link="l{0}"/>'
    '<origin xyz="{2} 0 0.1"/><axis xyz="{3}"/>'
    '<limit lower="-2" upper="2" velocity="2" effort="9"/></joint>'
)
AXES = ("0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
MODEL = """schema = "postproc.model/1"
[effects.joint_compliance]
stiffness_Nmm_per_rad = [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]
[effects.joint_offset]
offset_deg = [0.5, 0.012, 0.25, 0.75, 0.02, 0.125]
"""
HEAD = (
    "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,temp_C,time_s,fx_N,fy_N,fz_N,"
    "mx_Nm,my_Nm,mz_Nm,qd1_deg_s,qd2_deg_s,qd3_deg_s,qd4_deg_s,qd5_deg_s,qd6_deg_s"
)
ROW = "{0},-90,90,5,30,5,1000,50,1000,20,{0},5,5,100,1,1,1,0.5,0.5,0.5,0.5,0.5,0.5"
POINTS = "x,y,z,i,j,k,feed\n0,0,50.5,0,0,1,600\n10,5,0.5,0,0,1,600\n20,5,0.25,0,0,1,300\n"


def urdf() -> str:
    """An arm with all elements that hold numbers."""
    links = '<link name="b"/>' + LINK + "".join(f'<link name="l{i}"/>' for i in range(2, 7))
    joints = [JOINT.format(i, i - 1, 0.1 * i, axis) for i, axis in enumerate(AXES, 2)]
    return URDF.format(links=links, joints="\n".join(joints))


@dataclass(frozen=True)
class Input:
    """A file of numbers, the others that go with it, and the command that reads it.

    ``known``: words that have a meaning there, and on which lines, both as patterns.
    ``skip``: lines whose numbers are names, or are judged by other commands.
    """

    name: str
    text: str
    command: str
    others: dict[str, str] = field(default_factory=dict)
    known: tuple[tuple[str, str], ...] = ()
    skip: str = r"$^"


DATUM = (FIXTURES / "measuring_plan" / "datum.csv").read_text(encoding="utf-8")
CELL = CELL_TEXT + '[[obstacles]]\nname = "o"\nbox = { size_mm = [100, 100, 100] }\n'
CAMPAIGN = HEAD + "\n" + "\n".join(ROW.format(i) for i in range(6)) + "\n"
TRACE_HEAD = ",".join(f"q{k}_{side}_deg" for side in ("cmd", "act") for k in range(1, 7))
TRACE = f"time_s,{TRACE_HEAD}\n" + "".join(f"0.{k:03d}{',1.5' * 12}\n" for k in range(0, 200, 4))
LARGE = ("1e308", "(mass_kg|feed_mm_min|approximation_mm|joint_Nmm_per_rad)")
"""Without an upper bound: no use, and no harm."""
INPUTS = {
    "cell": Input("c.toml", CELL, "check c.toml", known=(LARGE, ("(1_0|0x1F)", ""))),
    "urdf": Input(
        "arm.urdf",
        urdf(),
        "check c.toml",
        {"c.toml": CELL_TEXT.replace('model = "kuka_kr500_r2830"', 'urdf = "arm.urdf"')},
        known=(("1e308", "effort"),),
        skip="name=|link=",
    ),
    "campaign": Input(
        "m.csv",
        CAMPAIGN,
        "predict m.csv --cell c.toml -o o.csv",
        {"c.toml": CELL_TEXT},
        known=(("nan", ""),),
        skip=f"{HEAD[:6]}|^[013-5],",
    ),
    "datum": Input(
        "d.csv",
        DATUM,
        "fit-base d.csv --cell c.toml",
        {"c.toml": CELL_TEXT},
        skip="id,|#",
    ),
    "trace": Input(
        "log.csv",
        TRACE,
        "diagnose --trace log.csv --cell c.toml",
        {"c.toml": CELL_TEXT},
        known=(("nan", ""),),
        skip=r"time_s|^0\.(1|0[1-9])",
    ),
    "model": Input(
        "model.toml",
        MODEL,
        "predict m.csv --cell c.toml --model model.toml -o o.csv",
        {"c.toml": CELL_TEXT, "m.csv": CAMPAIGN},
        known=(
            ("nan", ""),
            ("inf", "stiffness"),
            ("1e999", "stiffness"),
            ("1_0", ""),
            ("0x1F", ""),
        ),
        skip="schema",
    ),
    "csv": Input("p.csv", POINTS, "inspect p.csv", skip="feed"),
    "apt": Input("p.apt", APT_TEXT, "inspect p.apt", skip="LOADTL|DRILL|DEEP2|PARTNO|STOP|SPINDL"),
    "gcode": Input(
        "p.nc",
        "G21 G90 G17 G94\nT1 M6\nS3000. M3\nG0 X0. Y0. Z10.\nG1 Z-1. F120.\nX25.4 Y3.\n"
        "G2 X30.4 Y8. I0. J5.\nG0 Z10.\nG98 G81 X5. Y6. Z-4. R2. F90.\nG80\nM30\n",
        "inspect p.nc",
        skip="G21|T1|M3|G80|M30|G81",
    ),
    "delmia": Input(
        "p.xml",
        (FIXTURES / "olp_task" / "seam.xml").read_text(encoding="utf-8"),
        "inspect p.xml",
        skip="xml|name|id=|Name|ID",
    ),
}
NUMBER = re.compile(
    r'(?<![\w"_.#=-])-?\d+\.?\d*(e\d+)?(?![\w"_:])|(?<=[a-z]=")-?\d+\.?\d*(?=["\s])'
    r"|(?<=[XYZIJRF])-?\d+\.\d*(?=[ \n])"
)


def test_every_reader_of_cam_files_is_tried():
    assert {name for name, _ in READERS} <= set(INPUTS)


@pytest.mark.parametrize("kind", INPUTS)
def test_what_is_no_number_is_one_line_at_its_place(kind, tmp_path, monkeypatch, capfd):
    given = INPUTS[kind]
    monkeypatch.chdir(tmp_path)
    for name, text in given.others.items():
        Path(name).write_text(text, encoding="utf-8")
    command = given.command.split()
    Path(given.name).write_text(given.text, encoding="utf-8")
    assert app.run([*command, "--quiet"]) in (0, 1)
    capfd.readouterr()
    tried = 0
    for found in NUMBER.finditer(given.text):
        number = given.text.count("\n", 0, found.start()) + 1
        line = given.text.split("\n")[number - 1]
        if re.search(given.skip, line):
            continue
        for word in WORDS:
            if any(
                re.fullmatch(one, word) and re.search(around, line) for one, around in given.known
            ):
                continue
            bad = given.text[: found.start()] + word + given.text[found.end() :]
            Path(given.name).write_text(bad, encoding="utf-8")
            began = time.process_time()
            code = app.run([*command, "--quiet"])
            spent = time.process_time() - began
            err = capfd.readouterr().err
            where = f"{given.name}:{number}: error "
            assert (code, spent < ENDLESS) == (2, True), (word, number, line, err, code, spent)
            assert err.startswith(where), (word, number, line, err)
            assert len(err.strip().split("\n")) <= 3, err
            tried += 1
    assert tried >= 20


OPTIONS = [
    (name, option, kind)
    for name in app.COMMANDS
    for option in app.group.get_command(click.Context(app.group), name).params
    for kind in getattr(option.type, "types", [option.type])
    if isinstance(kind, click.FloatRange | click.types.FloatParamType)
]


def test_there_are_such_options():
    assert len({(name, option.name) for name, option, _ in OPTIONS}) >= 20


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "1e999"])
def test_every_number_of_every_option_is_finite(word):
    for _, option, kind in OPTIONS:
        with pytest.raises(click.BadParameter):
            kind.convert(word, option, None)


@pytest.mark.parametrize(
    "call",
    [
        "verify p.src --cell c.toml --tol-deg nan",
        "verify p.src --cell c.toml --tol-mm inf",
        "diff a b --tol-mm nan",
        "robots --reach nan",
        "sample --cell c.toml --box 0 0 0 1 1 1 -o out --angles 0,nan",
        "identify m.csv --cell c.toml -o m.toml --confidence nan",
    ],
)
def test_an_option_that_is_no_number_is_one_line(call, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    Path("c.toml").write_text(CELL_TEXT, encoding="utf-8")
    assert app.run(call.split()) == 2
    lines = capfd.readouterr().err.strip().splitlines()
    assert re.search(r"nan|inf", lines[0])
    assert len(lines) <= 2
