"""The cell file: what it means in SI, and what it says when something is wrong."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.cell.choices import ArcMotion, Index, Kss, PointService, Strategy
from postproc.cell.file import load_cell
from postproc.cell.reference import cell_reference
from postproc.cell.robotfile import load_robot
from postproc.cell.schema import call_keys
from postproc.collision.mesh import solid
from postproc.errors import CellError, ReadError
from postproc.geometry.frames import apply
from postproc.units import DEG, MM
from tests.cells import cell_text

FIXTURES = Path(__file__).parent / "data"
SMALLEST = 'schema = "postproc.cell/1"\n[robot]\nmodel = "kuka_kr500_r2830"\n'


def loaded(folder, text):
    path = folder / "cell.toml"
    path.write_text(text, encoding="utf-8")
    return load_cell(path)


def complaint(folder, text):
    with pytest.raises(CellError) as caught:
        loaded(folder, text)
    assert "\n" not in str(caught.value)
    return caught.value


def test_example_of_the_interface_in_si():
    cell = load_cell(FIXTURES / "drilling_kr500.toml")
    assert cell.name == "kr500_drilling"
    assert cell.robot.name == "kuka_kr500_r2830"
    np.testing.assert_allclose(cell.tool.T_flange_tcp[:3, 3], [0.107, 0.0, 0.362])
    np.testing.assert_array_equal(cell.tool.axis, [1.0, 0.0, 0.0])
    np.testing.assert_allclose(cell.tool.com, [0.0, 0.0, 0.18])
    np.testing.assert_allclose(cell.T_robroot_base[:3, 3], [1.5, 0.0, 0.6])
    wanted = [1.58e7, 6.12e6, 5.28e6, 4.66e5, 2.19e5, 3.49e5]
    np.testing.assert_allclose(cell.joint_stiffness, wanted)
    assert (cell.limits.joint_margin, cell.limits.singularity) == (2.0 * DEG, 5.0 * DEG)
    assert cell.optimize.range == (-math.pi, math.pi)
    assert cell.motion.feed == pytest.approx(0.01)
    assert cell.motion.rapid == 0.5
    assert cell.motion.approximation == pytest.approx(1e-3)
    assert [mesh.cutting for mesh in cell.tool.meshes] == [False, True]
    assert cell.tool.meshes[1].radius == pytest.approx(0.005)
    np.testing.assert_allclose(cell.obstacles[0].size, 0.1)
    assert cell.obstacles[0].name == "clamp"


def test_keys_of_a_call_take_the_place_of_those_of_the_cell(tmp_path):
    cell = loaded(tmp_path, f'{SMALLEST}[import]\nunits = "inch"\naccept_words = ["A"]\n')
    given = call_keys({"units": "mm", "task": None, "accept_words": "A,B", "recover": True})
    assert given == {"units": "mm", "accept_words": ("A", "B")}
    assert cell.with_keys(given).reading == replace(
        cell.reading, units="mm", accept_words=("A", "B")
    )
    assert cell.with_keys({"units": None, "columns": ""}) == cell
    chosen = cell.with_keys({"strategy": "each", "emitter": "mine", "cam_lines": False})
    assert (chosen.optimize.strategy, chosen.krl.emitter) == (Strategy.EACH, "mine")
    assert not chosen.krl.cam_lines
    with pytest.raises(CellError, match="PLN204: preset 'x': expected one of stiffest"):
        cell.with_keys({"preset": "x"})


def test_half_a_tracker_is_none(tmp_path):
    fault = complaint(tmp_path, f"{SMALLEST}[measuring]\nrange_sigma_mm = 0.01\n")
    assert "measuring: range_sigma_mm and angle_sigma_mm_per_m belong together" in str(fault)


def test_defaults_are_filled_in_and_marked(tmp_path):
    cell = loaded(tmp_path, SMALLEST)
    assert cell.name == "cell"
    np.testing.assert_array_equal(cell.tool.T_flange_tcp, np.eye(4))
    np.testing.assert_array_equal(cell.tool.axis, [0.0, 0.0, 1.0])
    assert math.isnan(cell.tool.mass)
    assert math.isnan(cell.motion.feed)
    assert cell.motion.home is None
    assert math.isinf(cell.limits.contact_depth)
    assert cell.optimize.objective == "axial"
    assert cell.krl.max_points_per_file == 1000
    assert cell.origins["limits.joint_margin_deg"].provenance == "assumed"
    assert cell.origins["robot.model"].provenance == "user"


def test_stiffness_of_the_robot_is_used_only_without_an_own_one(tmp_path):
    bare = loaded(tmp_path, SMALLEST)
    assert bare.origins["stiffness.joint_Nmm_per_rad"].provenance == "published"
    np.testing.assert_allclose(bare.joint_stiffness[0], 1.58e7)
    table = "[stiffness]\njoint_Nmm_per_rad = [1e9, 2e9, 3e9, 4e9, 5e9, 6e9]\n"
    own = loaded(tmp_path, SMALLEST + table)
    np.testing.assert_allclose(own.joint_stiffness, np.arange(1, 7) * 1e6)
    assert own.origins["stiffness.joint_Nmm_per_rad"].provenance == "user"
    other = loaded(tmp_path, SMALLEST.replace("kr500_r2830", "kr6_r900_2"))
    assert other.joint_stiffness is None


def test_kuka_angles_of_frames(tmp_path):
    cell = loaded(tmp_path, SMALLEST + "[workpiece]\nframe = { abc_deg = [90, 0, 0] }\n")
    np.testing.assert_allclose(cell.T_robroot_base[:3, 0], [0.0, 1.0, 0.0], atol=1e-15)


OVERRIDDEN = """
limits_deg = [[-10, 10], [-120, 10], [-90, 100], [-300, 300], [-90, 90], [-20, 20]]
speed_deg_s = [1, 2, 3, 4, 5, 6]
accel_deg_s2 = [6, 5, 4, 3, 2, 1]
payload_kg = 400
"""


def test_robot_numbers_can_be_overridden(tmp_path):
    robot = loaded(tmp_path, SMALLEST + OVERRIDDEN).robot
    np.testing.assert_allclose(robot.q_min / DEG, [-10, -120, -90, -300, -90, -20])
    np.testing.assert_allclose(robot.q_max / DEG, [10, 10, 100, 300, 90, 20])
    np.testing.assert_allclose(robot.qd_max / DEG, [1, 2, 3, 4, 5, 6])
    np.testing.assert_allclose(robot.qdd_max / DEG, [6, 5, 4, 3, 2, 1])
    assert robot.payload == 400
    for field in ("q_min", "q_max", "qd_max", "qdd_max", "payload"):
        assert robot.origins[field].provenance == "user"
    assert "qd_max.A1" not in robot.origins
    assert robot.origins["geometry"].provenance == "published"
    np.testing.assert_allclose(load_robot("kuka_kr500_r2830").q_max[0], 185 * DEG)


SOLIDS = """
link_meshes = [
    { link = 2, file = "part.stl", scale = 1000 },
    { link = 0, box = { size_mm = [1, 2, 3] } },
]
[tool]
axis = "-z"
meshes = [{ file = "part.stl", abc_deg = [0, 90, 0], scale = 25.4 }]
[workpiece]
meshes = [{ cylinder = { radius_mm = 5, length_mm = 8 }, xyz_mm = [1, 2, 3] }]
[[obstacles]]
box = { size_mm = [1, 1, 1] }
[[obstacles]]
name = "pillar"
file = "part.stl"
"""


def test_solids_of_all_owners(tmp_path):
    (tmp_path / "part.stl").write_bytes(b"solid part\nendsolid part\n")
    cell = loaded(tmp_path, SMALLEST + SOLIDS)
    (link, mesh), (base, box) = cell.robot.link_meshes
    assert (link, base) == (2, 0)
    assert mesh.file == tmp_path / "part.stl"
    assert mesh.scale == pytest.approx(1.0)
    np.testing.assert_allclose(box.size, [1e-3, 2e-3, 3e-3])
    assert cell.tool.meshes[0].scale == pytest.approx(0.0254)
    np.testing.assert_allclose(cell.tool.meshes[0].T_owner_mesh[:3, 0], [0, 0, -1], atol=1e-15)
    assert cell.workpiece.meshes[0].length == pytest.approx(8e-3)
    np.testing.assert_allclose(cell.workpiece.meshes[0].T_owner_mesh[:3, 3], [1e-3, 2e-3, 3e-3])
    assert [o.name for o in cell.obstacles] == ["obstacle 1", "pillar"]


EXTERNAL_AXES = """
[[external_axes]]
name = "E1"
kind = "rail"
axis = "+y"
range_mm = [-500, 4000]
speed_mm_s = 800
[[external_axes]]
name = "E2"
kind = "positioner"
axis = "+z"
abc_deg = [0, 90, 0]
xyz_mm = [2000, 0, 500]
range_deg = [-360, 360]
speed_deg_s = 40
"""


def test_external_axes(tmp_path):
    rail, table = loaded(tmp_path, SMALLEST + EXTERNAL_AXES).external_axes
    np.testing.assert_allclose(rail.axis, [0, 1, 0])
    assert (rail.q_min, rail.q_max, rail.qd_max) == pytest.approx((-0.5, 4.0, 0.8))
    np.testing.assert_allclose(table.axis, [1, 0, 0], atol=1e-15)
    assert table.q_max == pytest.approx(2 * math.pi)
    np.testing.assert_allclose(table.T_world_axis[:3, 3], [2.0, 0.0, 0.5])


OPTIONS = """
[optimize]
index = "ellipsoid"
strategy = "smooth"
step_deg = 180
key_every_mm = 250
key_corner_deg = 18
key_tags = [3, "H4"]
loss_bound_percent = 20
pins = { H3 = -90 }
lead_deg = [-18, 36]
tilt_step_deg = 9
[motion]
rapid_percent = 25
rapid_speed_m_s = 1.2
approach_mm = 20
chord_mm = 0.05
arcs = "lin"
points = "touch"
home_deg = [0, -90, 90, 0, 45, 0]
[krl]
kss = "8.5"
orientation_speed_deg_s = 90
path_speed_max_m_s = 0.5
inertia_kg_m2 = [1, 2, 3]
hooks = { stop = "HALT_HERE" }
"""


def test_options_are_typed_and_in_si(tmp_path):
    cell = loaded(tmp_path, SMALLEST + OPTIONS)
    wishes, motion, krl = cell.optimize, cell.motion, cell.krl
    assert (wishes.index, wishes.strategy) == (Index.ELLIPSOID, Strategy.SMOOTH)
    assert (wishes.step, wishes.key_every) == pytest.approx((math.pi, 0.25))
    assert (wishes.key_corner, wishes.loss_bound) == pytest.approx((math.pi / 10, 0.2))
    assert wishes.key_tags == ("3", "H4")
    assert wishes.pins == {"H3": pytest.approx(-math.pi / 2)}
    assert wishes.tilt.lead == pytest.approx((-math.pi / 10, math.pi / 5))
    assert (wishes.tilt.side, wishes.tilt.step) == ((0.0, 0.0), pytest.approx(math.pi / 20))
    assert (motion.rapid, motion.rapid_speed) == pytest.approx((0.25, 0.3))
    assert (motion.approach, motion.chord) == pytest.approx((0.02, 5e-5))
    assert (motion.arcs, motion.points) == (ArcMotion.LIN, PointService.TOUCH)
    assert motion.home[4] == pytest.approx(math.pi / 4)
    assert (krl.kss, krl.path_speed_max) == (Kss.V8_5, 0.5)
    assert krl.orientation_speed == pytest.approx(math.pi / 2)
    np.testing.assert_array_equal(cell.tool.inertia, [1.0, 2.0, 3.0])
    assert (krl.hooks["stop"], krl.hooks["spindle_on"]) == ("HALT_HERE", "PP_SPINDLE_ON")


def test_the_older_name_of_the_ellipsoid_index_is_read_and_not_shown(tmp_path):
    older = "seed"
    cell = loaded(tmp_path, SMALLEST + f'[optimize]\nindex = "{older}"\n')
    assert cell.optimize.index is Index.ELLIPSOID
    assert older not in cell_reference()
    assert '| `index` | `"compliance"` or `"ellipsoid"` |' in cell_reference()


def test_weights_as_objective(tmp_path):
    cell = loaded(tmp_path, SMALLEST + "[optimize]\nobjective = { axial = 0.7, normal = 0.3 }\n")
    assert dict(cell.optimize.objective) == {"axial": 0.7, "normal": 0.3}


def test_own_template_folder_is_found_beside_the_file(tmp_path, monkeypatch):
    (tmp_path / "mine").mkdir()
    monkeypatch.chdir(tmp_path)
    text = SMALLEST + '[krl]\ntemplate = "mine"\n'
    Path("cell.toml").write_text(text, encoding="utf-8")
    assert Path(load_cell("cell.toml").krl.template) == tmp_path / "mine"
    error = complaint(tmp_path, text.replace("mine", "yours"))
    assert (error.code, error.source.line) == ("CEL005", 5)


def test_urdf_robot(tmp_path):
    joints = "".join(
        f'<link name="l{i}"/><joint name="j{i}" type="revolute"><parent link="l{i - 1}"/>'
        f'<child link="l{i}"/><limit lower="-1" upper="2" velocity="3"/></joint>'
        for i in range(6)
    )
    (tmp_path / "arm.urdf").write_text(f'<robot name="toy"><link name="l-1"/>{joints}</robot>')
    text = 'schema = "postproc.cell/1"\n[robot]\nurdf = "arm.urdf"\n'
    robot = loaded(tmp_path, text).robot
    assert robot.name == "toy"
    assert robot.geometry.tip == "l5"
    np.testing.assert_allclose(robot.q_max, 2.0)
    error = complaint(tmp_path, text + 'tip = "hand"\n')
    assert (error.code, error.source.line) == ("CEL011", 3)
    error = complaint(tmp_path, text.replace("arm.urdf", "leg.urdf"))
    assert (error.code, error.source.line) == ("CEL005", 3)


WRONG = """
CEL002 | 5 | limits.clearence_mm | 'clearance_mm' | [limits];clearence_mm = 1
CEL002 | 4 | motions | 'motion' | [motions];rapid_percent = 1
CEL002 | 6 | tool.frame.xyz_m | 'xyz_mm' | [tool];axis = "+x";frame = { xyz_m = [0, 0, 1] }
CEL002 | 7 | obstacles[1].box.size | 'size_mm' | [[obstacles]];name = 'a';[obstacles.box];size = 1
CEL003 | 4 | external_axes[1]: key 'name' | is missing | [[external_axes]];kind = "rail"
CEL004 | 5 | tool.axis | found 'z' | [tool];axis = "z"
CEL004 | 5 | limits.clearance_mm | finite | [limits];clearance_mm = nan
CEL004 | 5 | limits.clearance_mm | finite | [limits];clearance_mm = inf
CEL004 | 5 | limits.clearance_mm | or equal to 0 | [limits];clearance_mm = -1
CEL004 | 5 | limits.clearance_mm | found '1 mm' | [limits];clearance_mm = "1 mm"
CEL004 | 5 | limits.clearance_mm | found True | [limits];clearance_mm = true
CEL004 | 5 | process.force_N | at least 3 | [process];force_N = [1, 2]
CEL004 | 7 | process.force_N[2] | found 'x' | [process];force_N = [;1,;'x',;3]
CEL004 | 5 | motion.rapid_percent | 100 | [motion];rapid_percent = 120
CEL004 | 5 | motion.home_deg | A2 = 90 is out | [motion];home_deg = [0, 90, 0, 0, 0, 0]
CEL004 | 4 | optimize | 10 is above -10 | [optimize];range_deg = [10, -10]
CEL004 | 5 | optimize.strategy | found 'best' | [optimize];strategy = "best"
CEL004 | 5 | optimize.index | 'compliance' or 'ellipsoid', found 'k' | [optimize];index = "k"
CEL004 | 5 | motion.points | found 'all' | [motion];points = "all"
CEL004 | 5 | motion.arcs | 'circ' or 'lin', found True | [motion];arcs = true
CEL004 | 5 | krl.motion | found 'sprung' | [krl];motion = "sprung"
CEL004 | 5 | krl.points | 'inline' or 'dat', found 'both' | [krl];points = "both"
CEL004 | 5 | krl.kss | '8.7', found 8.5 | [krl];kss = 8.5
CEL004 | 4 | krl: motion | spline needs KSS 8 | [krl];kss = "5";motion = "spline"
CEL004 | 5 | krl.split | found 'never' | [krl];split = "never"
CEL004 | 5 | krl.advance | equal to 5, found 6 | [krl];advance = 6
CEL004 | 5 | krl.path_speed_max_m_s | equal to 3, found 3.1 | [krl];path_speed_max_m_s = 3.1
CEL004 | 5 | krl.orientation_speed_deg_s | equal to 400 | [krl];orientation_speed_deg_s = 400.1
CEL004 | 5 | krl.orientation_speed_deg_s | than 0 | [krl];orientation_speed_deg_s = 0
CEL002 | 5 | krl.hooks.spindle | 'spindle_on' | [krl.hooks];spindle = "X"
CEL004 | 5 | krl.hooks.stop | found 'A B' | [krl.hooks];stop = "A B"
CEL004 | 5 | krl.hooks.stop | found 'XXXXX | [krl.hooks];stop = "XXXXXXXXXXXXXXXXXXXXXXXXX"
CEL017 | 6 | krl.hooks.stop and krl.hooks.signal | 'x' | [krl.hooks];stop = "X";signal = "x"
CEL017 | 5 | krl.hooks.stop and krl.hooks.signal | two | [krl.hooks];stop = "PP_SIGNAL"
CEL017 | 5 | krl.hooks.stop | 'HALT' is a KRL word | [krl.hooks];stop = "HALT"
CEL017 | 5 | krl.hooks.spindle_on | 'Bas' is a KRL word | [krl.hooks];spindle_on = "Bas"
CEL017 | 7 | .a and krl.hooks.stop | two | [process];hole = ["a"];[krl.hooks];a = "PP_STOP"
CEL004 | 4 | optimize | one above 0 | [optimize];objective = { axial = 0 }
CEL004 | 2 | robot | found both | urdf = "a.urdf"
CEL004 | 2 | robot | with urdf only | tip = "a"
CEL004 | 4 | obstacles[1] | none of them | [[obstacles]];name = 'a'
CEL004 | 5 | stiffness.joint_Nmm | than 0 | [stiffness];joint_Nmm_per_rad = [1, 1, 1, 1, 1, 0]
CEL004 | 2 | robot | limits_deg | limits_deg = [[1,0],[0,1],[0,1],[0,1],[0,1],[0,1]]
CEL004 | 4 | external_axes[1] | range_mm | [[external_axes]];name='E1';kind='rail';axis='+x'
CEL005 | 5 | workpiece.meshes[1] | 'no.stl' | [workpiece];meshes = [{ file = "no.stl" }]
CEL001 | 4 | not valid TOML | column | [limits
CEL001 | 5 | not valid TOML | column | [limits];clearance_mm = 1 mm
CEL001 | 6 | not valid TOML | overwrite | [limits];clearance_mm = 1;clearance_mm = 2
"""
"""Code, line, place, expected words, and what follows the smallest cell (``;`` ends a line)."""


@pytest.mark.parametrize("case", WRONG.strip().splitlines())
def test_wrong_keys_and_values_are_named_with_their_line(tmp_path, case):
    code, line, place, expected, text = (word.strip() for word in case.split("|"))
    error = complaint(tmp_path, SMALLEST + text.replace(";", "\n") + "\n")
    assert (error.code, error.source.line) == (code, int(line))
    assert place in error.message
    assert expected in error.message


def test_all_complaints_are_listed_the_first_by_line_first(tmp_path):
    error = complaint(
        tmp_path, SMALLEST + "[motion]\nrapid = 3\n[limits]\nclearance_mm = -1\nx = 2\n"
    )
    assert error.source.line == 5
    assert "line 7: limits.clearance_mm" in error.hint
    assert "line 8: unknown key 'limits.x'" in error.hint


def test_unknown_robot_names_the_nearest(tmp_path):
    error = complaint(tmp_path, SMALLEST.replace("kuka_kr500_r2830", "KR210 R2710-2"))
    assert error.code == "CEL010"
    assert error.source.line == 3
    assert "'kuka_kr210_r2700_2'" in error.message


@pytest.mark.parametrize("head", ["", 'schema = "postproc.cell/9"\n'])
def test_schema_is_asked_for(tmp_path, head):
    error = complaint(tmp_path, head + '[robot]\nmodel = "kuka_kr500_r2830"\n')
    assert error.code == ("CEL004" if head else "CEL003")
    assert "schema" in error.message


def test_files_that_are_no_cell(tmp_path):
    with pytest.raises(ReadError, match="IO001"):
        load_cell(tmp_path / "missing.toml")
    with pytest.raises(ReadError, match="IO002"):
        load_cell(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b'schema = 1\nx = "\xff\xfe"\n')
    with pytest.raises(CellError, match=r"binary.toml:2: error CEL001: not a text file"):
        load_cell(binary)
    binary.write_bytes(b"")
    with pytest.raises(CellError, match="CEL003"):
        load_cell(binary)
    binary.write_text("x = " + "[" * 5000, encoding="utf-8")
    with pytest.raises(CellError, match="CEL001"):
        load_cell(binary)


def test_windows_text_is_read(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_bytes(b"\xef\xbb\xbf" + SMALLEST.replace("\n", "\r\n").encode())
    assert load_cell(path).robot.name == "kuka_kr500_r2830"


def test_reference_page_names_every_key():
    page = cell_reference()
    for key in (
        "joint_margin_deg",
        "contact_depth_mm",
        "home_deg",
        "cutting",
        "max_points_per_file",
        "range_mm",
    ):
        assert f"| `{key}` |" in page
    assert '| `axis` | `"+x"`' in page
    assert (
        "## `[robot.base]`, `[tool.frame]`, `[tools.frame]`, `[tools.stand]`, `[workpiece.frame]`"
        in page
    )
    assert "list of 3: number" in page


@pytest.mark.parametrize("axis", ["+x", "-x", "+y", "-y", "+z", "-z"])
def test_the_cutter_lies_along_the_tool_axis(tmp_path, axis):
    """A cylinder from the TCP back along the axis, in the flange, whatever the frame's turn."""
    text = cell_text(tcp=(100, 20, 300), tcp_abc=(30, -40, 70)).replace(
        'axis = "+x"', f'axis = "{axis}"\ncutter = {{ diameter_mm = 6, length_mm = 80 }}'
    )
    tool = loaded(tmp_path, text).tool
    (cutter,) = tool.meshes
    points = apply(np.linalg.inv(tool.T_flange_tcp), solid(cutter).vertices) / MM
    way = np.eye(3)["xyz".index(axis[1])] * (1 if axis[0] == "+" else -1)
    along = points @ way
    across = np.linalg.norm(points - along[:, None] * way, axis=1)
    np.testing.assert_allclose([along.min(), along.max()], [-80, 0], atol=1e-9)
    assert np.all((across < 1e-9) | ((across > 3 - 1e-9) & (across < 3.1)))
