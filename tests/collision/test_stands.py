"""Tools that are not mounted: obstacles at their stands, gone while they work."""

import numpy as np
import pytest

from postproc.cell import parse_cell
from postproc.collision import Scene
from postproc.kinematics import build
from postproc.verification.verify import verify
from tests.samples import AT_PART, CELL_TEXT, HEAD, START, at, modules

TEXT = CELL_TEXT.replace(AT_PART["old"], AT_PART["new"])
HEAD_TOOL, _, REST = TEXT.partition("[tool]\n")
OWN, _, PLACES = REST.partition("[workpiece]")
MESH = "meshes = [{ box = { size_mm = [60, 60, 60] }, xyz_mm = [37, 0, 362] }]\n"
ROD = "meshes = [{ cylinder = { radius_mm = 40, length_mm = 700 }, xyz_mm = [0, 0, 350] }]\n"
STAND = "xyz_mm = [1200, 900, 700], abc_deg = [30, 20, 10]"
ONE = f"[[tools]]\n{OWN}{MESH}"
TWO = f'[[tools]]\nnumber = 2\nname = "rod"\naxis = "+z"\n{ROD}'
SAME = (
    '[[obstacles]]\nname = "rod"\ncylinder = {{ radius_mm = 40, length_mm = 700 }}\n'
    "xyz_mm = [{x:.9f}, {y:.9f}, {z:.9f}]\nabc_deg = [30, 20, 10]\n"
)


def cell(*tools, more=""):
    text = HEAD_TOOL + "".join(tools) + "[workpiece]" + PLACES + more
    return parse_cell(text.encode(), "cell.toml")


@pytest.fixture(scope="module")
def both():
    return cell(ONE, TWO + f"stand = {{ {STAND} }}\n")


def hits(cell):
    arm = build(cell.robot)
    low, high = np.asarray(cell.robot.q_min), np.asarray(cell.robot.q_max)
    q = np.random.default_rng(3).uniform(low, high, (1500, 6))
    return Scene.build(cell, arm).check(q).hit


def test_a_tool_on_its_stand_is_the_obstacle_that_has_its_shape(both):
    T = np.asarray(both.tools[1].T_world_stand)
    x, y, z = (T @ [0.0, 0.0, 0.35, 1.0])[:3] * 1e3
    alone, as_obstacle = cell(ONE), cell(ONE, more=SAME.format(x=x, y=y, z=z))
    assert (hits(both) == hits(as_obstacle)).all()
    assert (hits(both) != hits(alone)).sum() > 20


def test_a_mounted_tool_is_not_on_its_stand(both):
    assert (hits(both.with_tool(1)) == hits(cell(TWO))).all()


def test_a_shared_scene_knows_where_the_others_are(both):
    arm = build(both.robot)
    shared = Scene.shared(both, arm), Scene.shared(cell(ONE, TWO), arm)
    names = [{body.name for body in scene.bodies} for scene in shared]
    assert names[0] - names[1] == {"tool of rod on its stand"}


def codes(cell):
    return [item.code for item in Scene.build(cell, build(cell.robot)).findings]


def test_a_tool_without_a_place_is_noted(both):
    assert codes(cell(ONE, TWO)).count("COL107") == 1
    assert "COL107" in codes(both)  # the first one has none, once the second one works
    assert "COL107" not in codes(cell(ONE))
    assert "COL107" not in codes(cell(ONE + f"stand = {{ {STAND} }}\n", TWO.replace(ROD, "")))


def test_verify_sees_a_tool_in_the_way(both):
    lines = [*HEAD, START, at(-250, -40, 0), at(-250, 110, 0)]
    for tools, expected in ((cell(ONE), set()), (both, set())):
        report = verify(modules(*lines), "T", tools)
        assert {item.code for item in report.violations} == expected
    x, y, z = at_point(both)
    near = TWO + f"stand = {{ xyz_mm = [{x}, {y}, {z}] }}\n"
    report = verify(modules(*lines), "T", cell(ONE, near))
    assert {item.code for item in report.violations} == {"collision"}
    assert "rod on its stand" in report.violations[0].message


def at_point(cell):
    """Below a point of the path, in the world [mm]."""
    T = np.asarray(cell.robot.T_world_robroot @ cell.T_robroot_base)
    return np.round((T @ [-0.2, 0.03, 0.0, 1.0])[:3] * 1e3 - [0.0, 0.0, 350.0], 3).tolist()
