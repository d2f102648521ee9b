"""Feeds at axis limits, repeated points, slots there and back: good work that must convert."""

import re

import numpy as np
import pytest

import postproc as pp

CELL = """schema = "postproc.cell/1"
name = "feeds"
[robot]
model = "kuka_kr500_r2830"
[tool]
frame = { xyz_mm = [150, 0, 300], abc_deg = [0, 0, 0] }
axis = "+x"
[workpiece]
frame = { xyz_mm = [1700, 0, 700], abc_deg = [0, 0, 0] }
[stiffness]
joint_Nmm_per_rad = [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]
"""
HEAD = ["TOOL PATH/X,TOOL,T1", "TLDATA/MILL,10.0,0.0,50.0,0.0,0.0", "MSYS/0,0,0,1,0,0,0,1,0"]


@pytest.fixture
def convert(tmp_path):
    def converted(*lines, krl=""):
        (tmp_path / "cell.toml").write_text(CELL + krl, encoding="utf-8")
        part = tmp_path / "part.cls"
        part.write_text("\n".join([*HEAD, *lines, "END-OF-PATH", ""]), encoding="utf-8")
        cell = pp.load_cell(tmp_path / "cell.toml")
        job = pp.convert(part, cell)
        if job.good:
            job.write(tmp_path)
            assert pp.verify(tmp_path / f"{job.name}.src", cell, against=part).ok
        return job

    return converted


def errors(job):
    return [str(finding) for finding in job.findings if finding.severity == "error"]


def text(job):
    return job.files[f"{job.name}.src"].decode()


def line_targets(job):
    return re.findall(r"^LIN \{X (\S+),Y (\S+),Z ([^,]+),", text(job), re.M)


SLOT = (
    "RAPID", "GOTO/0,0,50,0,0,1", "RAPID", "GOTO/0,0,5",
    "FEDRAT/MMPM,200", "GOTO/0,0,-2",
    "FEDRAT/MMPM,600", "GOTO/100,0,-2",
    "FEDRAT/MMPM,900", "GOTO/0,0,-2", "GOTO/100,0,-2",
    "RAPID", "GOTO/100,0,50",
)  # fmt: skip


def test_a_slot_there_and_back_after_a_feed_change(convert):
    job = convert(*SLOT)
    assert errors(job) == []
    assert "$VEL.CP=0.015000" in text(job)  # 900 mm/min


def test_a_plunge_blended_before_is_still_an_error(convert, tmp_path):
    job = convert(*SLOT[:6], "RAPID", "GOTO/0,0,5")
    job.write(tmp_path)
    src = tmp_path / f"{job.name}.src"
    source = src.read_bytes().decode()
    lines = source.split("\r\n")
    plunge = next(i for i, line in enumerate(lines) if line.startswith("LIN") and ",Z -2.0" in line)
    before = max(i for i in range(plunge) if lines[i].startswith(("LIN", "PTP")))
    if "C_DIS" not in lines[before]:
        at = lines[before].index(" ;")
        lines[before] = f"{lines[before][:at]} C_DIS{lines[before][at:]}"
    src.write_bytes("\r\n".join(lines).encode())
    assert "KRL118" in {finding.code for finding in pp.lint(src)}


def test_a_repeated_point_has_no_motion_of_its_own_and_no_stop(convert):
    points = ["RAPID", "GOTO/0,0,0,0,0,1", "FEDRAT/MMPM,600", "GOTO/50,0,0"]
    once = convert(*points, "GOTO/100,0,0", "GOTO/150,0,0")
    twice = convert(*points, "GOTO/100,0,0", "GOTO/100,0,0", "GOTO/100,0,0", "GOTO/150,0,0")
    assert errors(twice) == []
    assert line_targets(twice) == line_targets(once)
    assert len(twice.tags) == len(once.tags) + 2
    assert twice.tags["stiffness_N_per_mm"][3] == twice.tags["stiffness_N_per_mm"][4]
    assert text(twice).count("C_DIS") == text(once).count("C_DIS") > 0


def test_a_spot_on_which_the_tool_only_turns_is_slow_enough_for_the_wrist(convert):
    job = convert(
        "RAPID", "GOTO/0,0,0,0,0,1", "FEDRAT/MMPM,600", "GOTO/100,0,0",
        f"GOTO/100,0,0,{np.sin(0.4):.7f},0,{np.cos(0.4):.7f}", "GOTO/150,0,0",
    )  # fmt: skip
    assert errors(job) == []
    spots = np.diff(job.plan.T_base_tcp[:, :3, 3], axis=0)
    spot = int(np.flatnonzero(np.linalg.norm(spots, axis=1) < 1e-9)[0]) + 1
    orientation = job.plan.orientation_speed[spot]
    R = job.plan.T_base_tcp[spot - 1, :3, :3].T @ job.plan.T_base_tcp[spot, :3, :3]
    angle = np.arccos((np.trace(R) - 1.0) / 2.0)
    speed = np.abs(job.plan.q[spot] - job.plan.q[spot - 1]) * orientation / angle
    assert (speed <= job.cell.robot.qd_max).all()
    slow = re.search(r"^\$VEL\.ORI1=(\S+)\r\n\$VEL\.ORI2=\1\r\nLIN", text(job), re.M)
    assert float(slow[1]) == pytest.approx(np.rad2deg(orientation), abs=1e-3)
    assert re.search(r"^\$VEL\.ORI1=200\.0", text(job), re.M)


def test_feeds_lowered_at_axis_limits_agree_with_the_check_and_are_one_finding(convert):
    """A five-axis path at 6 m/min: every share of the axes' speed occurs, 0.93 to 0.95 too."""
    t = np.linspace(0.0, 4.0 * np.pi, 160)
    n = np.stack([np.sin(0.4 * np.sin(3 * t)), np.sin(0.35 * np.cos(5 * t)), np.ones(160)], axis=1)
    n /= np.linalg.norm(n, axis=1)[:, None]
    rows = [
        f"GOTO/{80 * np.cos(a):.4f},{80 * np.sin(a):.4f},{5 * np.sin(4 * a):.4f},"
        f"{i:.7f},{j:.7f},{k:.7f}"
        for a, (i, j, k) in zip(t, n, strict=True)
    ]
    job = convert("RAPID", rows[0], "FEDRAT/MMPM,6000", *rows[1:])
    assert errors(job) == []
    lowered = [finding for finding in job.findings if finding.code == "PLN301"]
    assert len(lowered) == 1
    feeds = {float(v) for v in re.findall(r"\$VEL\.CP=(\S+)", text(job))}
    assert min(feeds) < 0.09 < max(feeds)


def test_hooks_example_with_a_spindle_word(convert):
    job = convert("SPINDL/RPM,3000,CLW", *SLOT, "SPINDL/OFF", krl="[krl]\nhooks_example = true\n")
    assert errors(job) == []


def test_small_arcs_at_an_axis_limit_agree_with_the_check(convert):
    """An arc as short as one sampled piece: its chord asks less of the axes than its way."""
    job = convert(
        "RAPID", "GOTO/0,0,30,0,0,1", "FEDRAT/MMPM,90000", "GOTO/10,0,0",
        "CIRCLE/5,0,0,0,0,1,5.0", "GOTO/0,0,0", "CIRCLE/5,0,0,0,0,1,5.0", "GOTO/10,0,0",
        "RAPID", "GOTO/10,0,50",
    )  # fmt: skip
    assert errors(job) == []
    speeds = [float(v) for v in re.findall(r"\$VEL\.CP=(\S+)", text(job))]
    assert any(speed < 1.5 for speed in speeds[1:])


def test_a_repeat_among_holes_in_free_order_keeps_the_feeds(convert):
    hole = "CYCLE/DRILL,FEDTO,-9,MMPM,60,RAPTO,3,RTRCTO,20"
    job = convert(
        "SPINDL/RPM,900,CLW", "RAPID", "GOTO/0,0,50,0,0,1", "FEDRAT/MMPM,9000", "GOTO/0,0,50",
        "FEDRAT/MMPM,300", "GOTO/40,0,-2", "GOTO/60,0,-2", hole, "GOTO/300,0,0", "GOTO/100,0,0",
        "GOTO/200,0,0", "CYCLE/OFF", "SPINDL/OFF", krl="[optimize]\nfree_order = true\n",
    )  # fmt: skip
    assert errors(job) == []
    assert job.plan.speed[job.plan.tag == 2].tolist() == [pytest.approx(0.005)]


def test_a_tilted_cut_that_ends_in_a_repeat_and_a_turn(convert):
    job = convert(
        "RAPID", "GOTO/0,0,30,0,0,1", "FEDRAT/MMPM,600", "GOTO/0,0,0", "GOTO/100,0,0",
        "GOTO/100,0,0", "GOTO/100,0,0,0.28,0,0.96", "RAPID", "GOTO/100,0,80",
        krl="[optimize]\nlead_deg = [-10, 10]\n",
    )  # fmt: skip
    assert errors(job) == []


@pytest.mark.parametrize("way", [5e-5, 5e-4])
def test_a_turn_on_a_way_that_the_text_rounds(convert, way):
    job = convert(
        "RAPID", "GOTO/0,0,0,0,0,1", "FEDRAT/MMPM,600", "GOTO/100,0,0",
        f"GOTO/{100 + way:.5f},0,0,0.001,0,0.9999995", "GOTO/150,0,0",
    )  # fmt: skip
    assert errors(job) == []


def test_a_rapid_to_where_a_hole_begins(convert):
    job = convert(
        "SPINDL/RPM,900,CLW", "RAPID", "GOTO/0,0,50,0,0,1", "RAPID", "GOTO/40,0,0", "STOP",
        "CYCLE/DRILL,FEDTO,-9,MMPM,60,RAPTO,3,RTRCTO,20", "GOTO/40,0,0", "CYCLE/OFF", "SPINDL/OFF",
    )  # fmt: skip
    assert errors(job) == []


def test_a_small_arc_is_not_blended_beyond_the_tolerance_of_a_corner(convert):
    """Where both motions bend away, the chord between the ends of a blend is the tolerance off."""
    job = convert(
        "RAPID", "GOTO/40,0,30,0,0,1", "FEDRAT/MMPM,600", "GOTO/2,0,0",
        "CIRCLE/0,0,0,0,0,-1,2.0,0.06,0.5,10.0,0.0", "GOTO/2,0,0",
        "GOTO/-40,0,0",
    )  # fmt: skip
    assert errors(job) == []
    reaches, reach = [], np.inf
    for line in text(job).splitlines():
        reach = float(line[10:]) if line.startswith("$APO.CDIS=") else reach
        reaches += [reach] if line.startswith("CIRC") and "C_DIS" in line else []
    assert len(reaches) >= 2
    for along in reaches[:2]:  # from piece to piece of the circle of 2 mm
        assert 2.0 * (1.0 - np.cos(along / 2.0)) <= 0.2 + 1e-4


def test_a_line_back_from_the_end_of_an_arc_need_not_stop_where_it_goes_on(convert):
    """The chord of an arc is not the way it ends: a half circle, then back over its diameter."""
    job = convert(
        "RAPID", "GOTO/0,0,30,0,0,1", "FEDRAT/MMPM,600", "GOTO/10,0,0",
        "CIRCLE/0,0,0,0,0,-1,10.0,0.06,0.5,10.0,0.0", "GOTO/-10,0,0", "GOTO/40,0,0",
        "CIRCLE/40,10,0,0,0,1,10.0,0.06,0.5,10.0,0.0", "GOTO/50,10,0",
    )  # fmt: skip
    assert errors(job) == []
    ends = [line for line in text(job).splitlines() if "{X -10.0000,Y 0.0000" in line]
    assert "C_DIS" in ends[-1], "a corner of 90 deg"
    back = [line for line in text(job).splitlines() if "{X 40.0000,Y 0.0000" in line]
    assert "C_DIS" not in back[-1], "the arc begins against the line"


def test_a_fast_cut_to_the_bottom_of_the_hole_before_it_is_a_cut(convert):
    job = convert(
        "SPINDL/RPM,900,CLW", "RAPID", "GOTO/0,0,50,0,0,1", "FEDRAT/MMPM,90000",
        "CYCLE/DRILL,FEDTO,0.0,MMPM,60,RAPTO,12,RTRCTO,20", "GOTO/40,0,-2", "CYCLE/OFF",
        "GOTO/40,0,-2", "GOTO/40,0,-2", "GOTO/60,0,-2", "RAPID", "GOTO/60,0,50", "SPINDL/OFF",
    )  # fmt: skip
    assert errors(job) == []
    bottoms = [target for target in line_targets(job) if target == ("40.0000", "0.0000", "-2.0000")]
    assert len(bottoms) == 2, "drilled, and gone back to at feed"


@pytest.mark.parametrize("order", ["", "[optimize]\nfree_order = true\n"])
@pytest.mark.parametrize("kind", ["DEEP", "BRKCHP"])
@pytest.mark.parametrize("depth", [9.009, 9.0005])
def test_the_last_peck_of_a_hole_that_is_drilled_twice_is_its_bottom(convert, order, kind, depth):
    """A last peck within the tolerance of the bottom: the one before it is none."""
    job = convert(
        "SPINDL/RPM,900,CLW", "RAPID", "GOTO/0,0,50,0,0,1", "FEDRAT/MMPM,600",
        f"CYCLE/DRILL,{kind},STEP,3,FEDTO,-{depth},MMPM,60,RAPTO,3,RTRCTO,20,DWELL,.4",
        "GOTO/40,0,-2", "GOTO/40,0,-2", "GOTO/60,0,-2", "CYCLE/OFF", "SPINDL/OFF",
        krl=order or "[krl]\nmax_points_per_file = 5\n",
    )  # fmt: skip
    assert errors(job) == []
    every = "".join(data.decode() for name, data in job.files.items() if name.endswith(".src"))
    assert len(re.findall(rf"^LIN .*Z -{2 + depth:.4f},.*$\s+WAIT SEC 0\.4", every, re.M)) == 3


SAME_PLACE = {
    "deep, then a spot": ["DRILL,FEDTO,-30", "DRILL,FEDTO,-5"],
    "a spot, then pecks": ["DRILL,FEDTO,-5", "DRILL,DEEP,STEP,8,FEDTO,-30"],
    "pecks, ream and bore": ["DRILL,DEEP,STEP,8,FEDTO,-30", "REAM,FEDTO,-25", "BORE,FEDTO,-20"],
    "pecks three times": [f"DRILL,DEEP,STEP,5,FEDTO,-{depth}" for depth in (15, 25, 15)],
}


@pytest.mark.parametrize("cycles", SAME_PLACE.values(), ids=SAME_PLACE)
def test_holes_at_one_place_are_each_judged_by_their_own_strokes(convert, cycles):
    lines = [f"CYCLE/{cycle},MMPM,60,RAPTO,3,RTRCTO,20" for cycle in cycles]
    job = convert(
        "SPINDL/RPM,900,CLW", "RAPID", "GOTO/0,0,50,0,0,1", "FEDRAT/MMPM,600",
        *[line for cycle in lines for line in (cycle, "GOTO/40,0,0", "CYCLE/OFF")], "SPINDL/OFF",
    )  # fmt: skip
    assert errors(job) == []
    depths = [float(z) for x, _, z in line_targets(job) if x == "40.0000"]
    bottoms = [float(cycle.split("-")[-1]) for cycle in cycles]
    for bottom in bottoms:
        depths = depths[depths.index(-bottom) + 1 :]


def test_holes_whose_axes_meet_at_their_bottom(convert):
    job = convert(
        "SPINDL/RPM,900,CLW", "RAPID", "GOTO/0,0,50,0,0,1",
        "CYCLE/DRILL,FEDTO,-10,MMPM,60,RAPTO,3,RTRCTO,20", "GOTO/20,0,0,0,0,1",
        "GOTO/22.8,0,-0.4,0.28,0,0.96", "GOTO/20,0,0,0,0,1", "CYCLE/OFF", "SPINDL/OFF",
    )  # fmt: skip
    assert errors(job) == []


def test_a_hole_above_the_end_of_a_cut(convert):
    job = convert(
        "SPINDL/RPM,900,CLW", "RAPID", "GOTO/20,0,20,0,0,1", "FEDRAT/MMPM,600", "GOTO/20,0,-20",
        "CYCLE/DRILL,FEDTO,-5,MMPM,60,RAPTO,3,RTRCTO,20", "GOTO/20,0,0", "CYCLE/OFF", "SPINDL/OFF",
    )  # fmt: skip
    assert errors(job) == []


@pytest.mark.parametrize("tolerance", [0.0003, 0.00043, 0.002])
def test_a_tolerance_as_fine_as_the_digits_of_the_text(convert, tolerance):
    """Corners of lines 2 mm long that 0.9 mm of blending would just be allowed to pass."""
    aside = 0.995 * tolerance / 0.45
    bends = [f"GOTO/{2 * k},{aside * (k % 2):.7f},0" for k in range(20)]
    job = convert(
        "RAPID", "GOTO/0,0,30,0,0,1", "FEDRAT/MMPM,600", *bends,
        krl=f"[motion]\ncorner_tolerance_mm = {tolerance}\n",
    )  # fmt: skip
    assert errors(job) == []


@pytest.mark.parametrize("order", ["false", "true"])
def test_a_point_to_touch_that_is_listed_twice_is_touched_twice(tmp_path, order):
    options = f'[motion]\npoints = "touch"\n[optimize]\nfree_order = {order}\n'
    (tmp_path / "cell.toml").write_text(CELL + options, encoding="utf-8")
    part = tmp_path / "part.csv"
    rows = ["x,y,z,i,j,k", *["0,0,0,0,0,1"] * 2, "50,0,0,0,0,1"]
    part.write_text("\n".join([*rows, ""]), encoding="utf-8")
    cell = pp.load_cell(tmp_path / "cell.toml")
    job = pp.convert(part, cell)
    assert job.good, errors(job)
    job.write(tmp_path)
    assert pp.verify(tmp_path / f"{job.name}.src", cell, against=part).ok
    touched = [(float(x), float(z)) for x, _, z in line_targets(job)]
    assert sorted(x for x, z in touched if z == 0.0) == [0.0, 0.0, 50.0]
