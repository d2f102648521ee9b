"""DELMIA targets that hold joint angles only, of a robot that is not the cell's."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from postproc.cli import app
from postproc.errors import PlanError
from postproc.planning.planner import plan
from postproc.planning.states.place import place
from postproc.planning.states.settings import PlanOptions
from postproc.readers import ReadOptions, read
from tests.cells import FEED, cell_text

POSE = (
    "<CartesianTarget>"
    '<Position Units="mm" X="{}" Y="{}" Z="{}"/>'
    '<Orientation Pitch="0" Roll="0" Units="deg" Yaw="0"/>'
    "</CartesianTarget>"
)
JOINTS = (
    '<JointTarget><Joint DOFNumber="1" Units="deg"><JointValue>10</JointValue></Joint>'
    "</JointTarget>"
)


def olp(targets):
    """Return an OLP document of (motion type, xyz [mm] or None for joints only)."""
    activities = []
    for number, (kind, xyz) in enumerate(targets):
        target = JOINTS if xyz is None else POSE.format(*xyz)
        activities.append(
            f'<Activity ActivityType="DNBRobotMotionActivity" Operation="P.{number}">'
            f"<MotionAttributes><MotionType>{kind}</MotionType></MotionAttributes>"
            f"<Target>{target}</Target></Activity>"
        )
    lines = "\n".join(activities)
    task = f'<ActivityList Task="T">\n{lines}\n</ActivityList>'
    return f"<OLPData>\n<Resource>\n{task}\n</Resource>\n</OLPData>\n"


PATH = [
    ("Joint", None),
    ("Joint", (1800, 0, 1200)),
    ("Linear", (1900, 0, 1200)),
    ("Joint", None),
    ("Joint", (1800, 200, 1200)),
    ("Linear", (1900, 200, 1200)),
    ("Linear", (1900, 300, 1200)),
]
WITHOUT = [0, 3]


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "job.xml"
    path.write_text(olp(PATH))
    return path


@pytest.fixture
def toolpath(source):
    return read(str(source), options=ReadOptions(tool_axis=(1, 0, 0)))


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize("strategy", ["global", "smooth", "each"])
def test_each_such_tag_fails_by_its_line(toolpath, make_cell, strategy):
    result = plan(toolpath, make_cell().with_keys({"strategy": strategy}))
    errors = [(i.code, i.tag_index, i.source.line) for i in result.errors]
    assert errors == [("PLN206", tag, 4 + tag) for tag in WITHOUT]
    assert all(
        "nothing in the file proves that they are for the cell's arm" in i.message
        for i in result.errors
    )
    for values in (result.T_base_tcp, result.q):
        assert np.isfinite(values).all()


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize("strategy", ["global", "smooth", "each"])
def test_the_others_are_planned_in_part(toolpath, make_cell, strategy):
    result = plan(
        toolpath, make_cell().with_keys({"strategy": strategy}), PlanOptions(partial=True)
    )
    assert {i.code for i in result.errors} == {"PLN206"}
    assert set(result.tag.tolist()) == set(range(len(PATH))) - set(WITHOUT)
    served = [result.T_base_tcp[result.tag == tag, :3, 3] for tag in (1, 2, 4, 5, 6)]
    wanted = toolpath.points[[1, 2, 4, 5, 6]]
    gaps = [np.linalg.norm(p - w, axis=1).min() for p, w in zip(served, wanted, strict=True)]
    assert max(gaps) < 1e-9


def test_placement_refuses_them(toolpath, make_cell):
    with pytest.raises(PlanError, match=r"job\.xml:4: error PLN206"):
        place(toolpath, make_cell())


def test_only_joint_targets(tmp_path, make_cell):
    path = tmp_path / "joints.xml"
    path.write_text(olp([("Joint", None)] * 3))
    result = plan(read(str(path)), make_cell())
    assert [i.tag_index for i in result.errors] == [0, 1, 2]


@pytest.mark.parametrize("partial", [False, True])
def test_from_the_command_line(tmp_path, source, capsys, partial):
    cell, out = tmp_path / "cell.toml", tmp_path / "out"
    cell.write_text(cell_text(FEED, origin=(0, 0, 0)))
    page = tmp_path / "page.html"
    call = ["convert", str(source), "--cell", str(cell), "-o", str(out), "--json"]
    code = app.run([*call, "--report", str(page), *(["--partial"] if partial else [])])
    said = capsys.readouterr()
    answer = json.loads(said.out or said.err)
    assert code == 1
    assert [(f["tag"], f["line"], f["code"]) for f in answer["failures"]] == [
        (tag, 4 + tag, "PLN206") for tag in WITHOUT
    ]
    assert out.exists() == partial
    if partial:
        program = str(next(out.glob("*.src")))
        assert app.run(["verify", program, "--cell", str(cell), "--against", str(source)]) == 2
        assert "job.xml:4: error VER001: tag P.0" in capsys.readouterr().err
    assert not re.search(
        r"\bNaN\b", re.search(r'id="data">(.*?)</script>', page.read_text(), re.S)[1]
    )


def test_an_arc_cannot_start_there(tmp_path, capsys):
    path = tmp_path / "arc.xml"
    path.write_text(
        olp([("Joint", None), ("CircularVia", (1850, 50, 1200)), ("Circular", (1900, 0, 1200))])
    )
    assert app.run(["inspect", str(path)]) == 2
    assert "arc.xml:6: error DEL020: an arc needs Cartesian targets" in capsys.readouterr().err
