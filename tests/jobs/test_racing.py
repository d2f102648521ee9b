"""Cuts on which an axis races: their feeds against finite differences of the joints."""

import re

import numpy as np
import pytest

import postproc as pp
from postproc.kinematics import build
from postproc.krl.text.parse import parse_files
from postproc.model import MoveRole
from postproc.units import MM_PER_MIN
from postproc.verification.verify import verify

CELL = """schema = "postproc.cell/1"
name = "racing"
[robot]
model = "{model}"
[tool]
frame = {{ xyz_mm = [0, 0, {tool}], abc_deg = [0, 0, 0] }}
axis = "+z"
[workpiece]
frame = {{ xyz_mm = {xyz}, abc_deg = {abc} }}
[optimize]
range_deg = {spins}
[limits]
singularity_deg = 0.1
"""
STRETCHED = (
    {
        "model": "kuka_kr120_r2700_2",
        "tool": 300,
        "xyz": [1904.540, -428.575, 2767.822],
        "abc": [72.0492, -38.1512, -93.4856],
        "spins": [-10, 10],
    },
    30000,
    [
        (-96.8139, -72.9508),
        (-61.8382, -51.3250),
        (-29.5669, -27.0081),
        (0.0, 0.0),
        (26.8625, 29.6992),
        (51.0206, 62.0896),
        (72.4743, 97.1712),
    ],
)
"""The third and fourth cut end and begin where A3 is 0.2 degrees from the stretched arm."""
OVERHEAD = (
    {
        "model": "kuka_kr6_r900_2",
        "tool": 120,
        "xyz": [23.635, -52.262, 1418.288],
        "abc": [113.3657, -18.8790, -170.7088],
        "spins": [-180, 180],
    },
    12000,
    [(-25.7732, 96.6221), (-8.4046, 32.2577), (8.9640, -32.1067), (26.3326, -96.4711)],
)
"""The wrist centre passes axis 1 within millimetres."""


@pytest.fixture(params=[STRETCHED, OVERHEAD], ids=["stretched", "overhead"], scope="module")
def made(request, tmp_path_factory):
    """The job, the cell, the toolpath and the feed asked for [m/s]."""
    frame, feed, points = request.param
    folder = tmp_path_factory.mktemp("racing")
    (folder / "cell.toml").write_text(CELL.format(**frame), encoding="utf-8")
    goto = [f"GOTO/{x},{y},{{}},0,0,1" for x, y in points]
    cut = [line.format(0) for line in goto]
    lines = ["UNITS/MM", "RAPID", goto[0].format(20), f"FEDRAT/MMPM,{feed}", *cut, "RAPID"]
    (folder / "part.apt").write_text("\n".join([*lines, goto[-1].format(20), "FINI", ""]))
    cell = pp.load_cell(folder / "cell.toml")
    job = pp.convert(folder / "part.apt", cell)
    return job, cell, pp.read(folder / "part.apt", cell), feed * MM_PER_MIN


def rates(job, cell):
    """The largest rate [1/m] of any axis, in shares of its speed, on each cut; orientation held."""
    kinematics, q = build(cell.robot), job.plan.q
    found = {}
    for row in np.flatnonzero(job.plan.role == MoveRole.CUT).tolist():
        T_from, T_to = kinematics.fk(q[row - 1]), kinematics.fk(q[row])
        way = T_to[:3, 3] - T_from[:3, 3]
        T = np.repeat(T_to[None], 20001, axis=0)
        T[:, :3, 3] = T_from[:3, 3] + np.linspace(0.0, 1.0, len(T))[:, None] * way
        on_way, _ = kinematics.ik_in(T, np.full(len(T), int(kinematics.slot(q[row]))))
        step = np.diff(np.unwrap(on_way, axis=0), axis=0) * 20000 / np.linalg.norm(way)
        found[row] = (np.abs(step) / cell.robot.qd_max).max()
    return found


def test_the_axes_can_follow_and_no_feed_is_lower_than_that_takes(made):
    job, cell, _, feed = made
    assert [str(f) for f in job.findings if f.severity == "error"] == []
    lowered = 0
    for row, rate in rates(job, cell).items():
        need = rate * job.plan.speed[row]
        assert need < 0.96
        if job.plan.speed[row] < feed * 0.999:
            assert need > 0.82
            lowered += 1
    assert lowered >= 1
    assert "PLN301" in {f.code for f in job.findings}


def test_verify_sees_feeds_that_are_too_high_and_lower_than_needed(made):
    job, cell, toolpath, feed = made
    name = f"{job.name}.src"
    text = job.files[name].decode()
    slow = min(re.findall(r"^\$VEL\.CP=(\S+)", text, re.M), key=float)

    def kinds(speed):
        broken = text.replace(f"$VEL.CP={slow}", f"$VEL.CP={speed:.6f}")
        modules = parse_files({**job.files, name: broken.encode()})
        report = verify(modules, modules[0].name, cell, toolpath, collisions=False)
        return {violation.code for violation in report.violations}

    assert kinds(float(slow)) == set()
    assert kinds(feed) == {"axis_speed"}
    assert kinds(1.2 * float(slow)) == {"axis_speed"}
    assert kinds(0.75 * float(slow)) == {"feed"}
