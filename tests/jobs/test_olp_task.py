"""An OLP task as the planner of the cell made it: joints, profiles, frames, signals, in order."""

import re

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.controller import EventWord
from postproc.controller.modules import load_program
from postproc.kinematics import build
from postproc.paths import joint_paths, run_in_cell
from tests import wing

HOME = (0.0, -90.0, 90.0, 0.0, 45.0, 0.0)
TURNED = (10.0, -80.0, 100.0, 190.0, 60.0, -200.0)
"""A joint target a whole turn away from what inverse kinematics would take."""
FRAMES = {"Jig": (1500.0, -300.0, 600.0), "Rear": (1500.0, 200.0, 600.0)}
PROFILES = """\
<ToolProfileList><ToolProfile><Name>Drill</Name></ToolProfile>
<ToolProfile><Name>Ream</Name></ToolProfile></ToolProfileList>
<MotionProfileList><MotionProfile><Name>Slow</Name><MotionBasis>Absolute</MotionBasis>
<Speed Value="0.01" Units="m/s"/></MotionProfile></MotionProfileList>
"""


def frame_xml(name, xyz):
    x, y, z = (v / 1000 for v in xyz)
    return (
        f'<ObjectFrameProfile><Name>{name}</Name><ObjectFrame ReferenceFrame="World">'
        f'<ObjectFramePosition X="{x}" Y="{y}" Z="{z}" Units="m"/>'
        '<ObjectFrameOrientation Yaw="0" Pitch="0" Roll="0" Units="deg"/>'
        "</ObjectFrame></ObjectFrameProfile>"
    )


def motion_xml(kind, tool, frame, target):
    return (
        '<Activity ActivityType="DNBRobotMotionActivity" Operation="P"><MotionAttributes>'
        f"<MotionType>{kind}</MotionType><ToolProfile>{tool}</ToolProfile>"
        f"<ObjectFrameProfile>{frame}</ObjectFrameProfile><MotionProfile>Slow</MotionProfile>"
        f"</MotionAttributes><Target>{target}</Target></Activity>"
    )


def joints_xml(angles):
    joints = "".join(
        f'<Joint DOFNumber="{i}" Units="deg"><JointValue>\n {v} </JointValue></Joint>'
        for i, v in enumerate(angles, start=1)
    )
    return f"<JointTarget>{joints}</JointTarget>"


def pose_xml(x, y, z, roll=0.0):
    return (
        f'<CartesianTarget><Position Units="m" X="{x / 1e3}" Y="{y / 1e3}" Z="{z / 1e3}"/>'
        f'<Orientation Units="deg" Pitch="90" Roll="{roll}" Yaw="0"/></CartesianTarget>'
    )


def signal_xml(kind, name, value, port):
    return (
        f'<Activity ActivityType="{kind}"><ActivityName>A</ActivityName><SetSignalAttributes>'
        f'<SetSignal SignalName="{name}" SignalValue="{value}" PortNumber="{port}"/>'
        "</SetSignalAttributes></Activity>"
    )


DELAY = (
    '<Activity ActivityType="DelayActivity"><ActivityName>D</ActivityName><ActivityTime>'
    "<StartTime>1.5</StartTime><EndTime>2.25</EndTime></ActivityTime></Activity>"
)


def task_xml(*extra):
    """Return a task that drills in one frame and reams in another."""

    def home(tool, frame):
        return motion_xml("Joint", tool, frame, joints_xml(HOME))

    def stroke(tool, frame, x):
        above = motion_xml("Joint", tool, frame, pose_xml(x, 40, 60))
        near = motion_xml("Linear", tool, frame, pose_xml(x, 40, 5))
        into = motion_xml("Linear", tool, frame, pose_xml(x, 40, -8, roll=25.0))
        out = motion_xml("Linear", tool, frame, pose_xml(x, 40, 60))
        return [above, near, into, DELAY, out]

    items = [
        home("Drill", "Jig"),
        signal_xml("DNBSetSignalActivity", "CLAMP", "On", 12),
        signal_xml("DNBWaitSignalActivity", "CLAMPED", "On", 0),
        motion_xml("Joint", "Drill", "Jig", joints_xml(TURNED)),
        *stroke("Drill", "Jig", 50),
        home("Drill", "Jig"),
        *extra,
        *stroke("Ream", "Rear", 90),
        signal_xml("DNBSetSignalActivity", "CLAMP", "Off", 12),
        home("Ream", "Rear"),
    ]
    frames = "".join(frame_xml(*item) for item in FRAMES.items())
    head = f"<Controller>{PROFILES}<ObjectFrameProfileList>{frames}</ObjectFrameProfileList>"
    body = "\n".join(items)
    return (
        f'<OLPData><Resource>{head}</Controller>\n<ActivityList Task="T">\n{body}\n'
        "</ActivityList></Resource></OLPData>\n"
    )


def cell_of(*tables, bases=('["Jig"]', '["Rear"]')):
    tools = [
        wing.tool_text(1, "DRILL").replace('"DRILL"]', '"Drill"]'),
        wing.tool_text(3, "REAM").replace('"REAM"]', '"Ream"]'),
    ]
    placed = [wing.base_text(i, cam) for i, cam in enumerate(bases, start=1)]
    text = wing.HEAD + "".join([*tools, *placed]) + wing.HOME + "".join(tables)
    return text.replace("abc_deg = [5, 0, 0]", "abc_deg = [0, 0, 0]")


@pytest.fixture
def converted(tmp_path, run):
    def convert(cell_text, text=None):
        cam, cell, out = tmp_path / "job.xml", tmp_path / "cell.toml", tmp_path / "out"
        cam.write_text(text or task_xml())
        cell.write_text(cell_text)
        call = ("convert", cam, "--cell", cell, "-o", out, "--json")
        return cam, cell, out / "job.src", run(*call)

    return convert


def ran(program, cell):
    cell = load_cell(cell)
    modules, kinematics = load_program(program), build(cell.robot)
    trace = run_in_cell(modules, modules[0].name, cell, kinematics)
    paths = joint_paths(trace, cell, kinematics)
    return trace, paths


def test_joints_are_met_to_the_turn(converted, run):
    cam, cell, program, (code, document, err) = converted(cell_of())
    assert (code, document["failures"]) == (0, []), err
    _, paths = ran(program, cell)
    q = np.degrees(paths.q)
    for target in (HOME, TURNED):
        assert np.abs(q - target).max(axis=1).min() < 1e-4, target
    assert (np.abs(q - HOME).max(axis=1) < 1e-4).sum() >= 3
    code, report, _ = run("verify", program, "--cell", cell, "--against", cam, "--json")
    assert (code, report["violations"]) == (0, [])


def test_the_tool_does_not_roll_in_a_stroke(converted):
    _, cell, program, _ = converted(cell_of())
    trace, paths = ran(program, cell)
    T = paths.curves.T_robroot_flange
    turned = 0
    for row in np.flatnonzero(trace.is_cp):
        R = T[row - 1, :3, :3].T @ T[row, :3, :3]
        angle = np.degrees(np.arccos(np.clip(0.5 * (np.trace(R) - 1.0), -1.0, 1.0)))
        straight = np.abs(paths.end_point[row] - paths.end_point[row - 1])
        if straight[2] > 1e-3 and straight[:2].max() < 1e-6:
            turned += 1
            assert angle < 0.001
    assert turned >= 6


def test_statements_stand_in_their_order(converted):
    _, cell, program, _ = converted(cell_of())
    trace, _ = ran(program, cell)
    words = {EventWord.HOOK: "hook", EventWord.DWELL: "dwell"}
    seen = [
        (event.name, event.arguments[1:]) if event.word is EventWord.HOOK else event.value
        for event in trace.events
        if event.word in words and (event.word is EventWord.DWELL or "SIGNAL" in event.name)
    ]
    assert seen == [
        ("PP_SIGNAL", (12, True)), ("PP_WAIT_SIGNAL", (0, True)), 0.75, 0.75,
        ("PP_SIGNAL", (12, False)),
    ]  # fmt: skip
    text = program.read_text()
    assert 'PP_SIGNAL("CLAMP",12,TRUE)' in text
    assert 'PP_WAIT_SIGNAL("CLAMPED",0,TRUE)' in text
    frames = re.findall(r"BAS\(#(TOOL|BASE),(\d)\)", text)
    assert frames[:2] == [("TOOL", "7"), ("BASE", "3")]
    assert frames[-2:] == [("TOOL", "9"), ("BASE", "4")]


def test_signals_that_the_cell_maps(converted, run):
    keys = "[krl]\noutputs = { CLAMP = 33 }\ninputs = { CLAMPED = 34 }\n"
    cam, cell, program, (code, _, err) = converted(cell_of(keys))
    assert code == 0, err
    text = program.read_text()
    assert re.findall(r"\$OUT\[33\]=\w+|WAIT FOR \$IN\[34\]==TRUE", text) == [
        "$OUT[33]=TRUE", "WAIT FOR $IN[34]==TRUE", "$OUT[33]=FALSE",
    ]  # fmt: skip
    assert run("verify", program, "--cell", cell, "--against", cam, "--json")[0] == 0


def verdict(run, program, text, cell, cam):
    """Exit code and kinds of violations of another text of a program."""
    program.write_text(text, newline="")
    code, report, _ = run("verify", program, "--cell", cell, "--against", cam, "--json")
    return code, {item["kind"] for item in report["violations"]}


def test_verify_misses_a_signal(converted, run):
    cam, cell, program, _ = converted(cell_of())
    text = program.read_text()
    for wrong in (
        re.sub(r"PP_SIGNAL\(\"CLAMP\",12,TRUE\).*\n", "", text),
        text.replace('PP_SIGNAL("CLAMP",12,TRUE)', 'PP_SIGNAL("CLAMP",12,FALSE)'),
        text.replace('PP_SIGNAL("CLAMP",12,TRUE)', 'PP_SIGNAL("CLAMP",13,TRUE)'),
        text.replace('PP_SIGNAL("CLAMP",12,TRUE)', 'PP_SIGNAL("VACUUM",12,TRUE)'),
    ):
        assert wrong != text
        assert verdict(run, program, wrong, cell, cam) == (1, {"event"})


def test_verify_misses_a_signal_that_the_cell_maps(converted, run):
    keys = "[krl]\noutputs = { CLAMP = 33 }\ninputs = { CLAMPED = 34 }\n"
    cam, cell, program, _ = converted(cell_of(keys))
    text = program.read_text()
    for wrong in (
        re.sub(r"\$OUT\[33\]=TRUE.*\n", "", text),
        text.replace("$OUT[33]=TRUE", "$OUT[33]=FALSE"),
        text.replace("$OUT[33]=TRUE", "$OUT[32]=TRUE"),
        text.replace("\nPTP", "\n$OUT[33]=FALSE\nPTP", 1),
        re.sub(r"WAIT FOR \$IN.*\n", "", text),
        text.replace("$IN[34]==TRUE", "$IN[34]==FALSE"),
        text.replace("$IN[34]==TRUE", "$IN[35]==TRUE"),
    ):
        assert wrong != text
        assert verdict(run, program, wrong, cell, cam) == (1, {"event"})


def test_an_unknown_activity_stops_by_name(converted):
    other = '<Activity ActivityType="GrabActivity"><ActivityName>G</ActivityName></Activity>'
    *_, (code, document, _) = converted(cell_of(), task_xml(other))
    assert code == 1
    assert any("GrabActivity" in item["detail"] for item in document["failures"])


def test_a_profile_that_nobody_claims_stops(converted):
    text = cell_of().replace('"Ream"]', '"Reamer"]')
    *_, (code, document, _) = converted(text.replace('cam = [3, "Reamer"]', 'cam = ["Reamer"]'))
    assert code == 1
    assert {item["code"] for item in document["failures"]} == {"WRD002"}
    assert "Ream" in document["failures"][0]["detail"]
