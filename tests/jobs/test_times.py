"""Cycle times where somebody has said what accelerations, jerks and torques the axes take."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from postproc.cell import load_cell, parse_cell
from postproc.errors import CellError
from postproc.jobs.check_cell import check_cell
from postproc.jobs.convert import ConvertRequest, convert
from postproc.kinematics import build, dynamics_of
from postproc.krl.text.parse import parse_files
from postproc.verification.verify import verify
from tests.cells import STIFFNESS, cell_text
from tests.kinematics.urdf_text import heavy_urdf
from tools.bench.contours import contour

FAST = 0.5
"""Feed [m/s] at which the axes are busy on a contour of 150 mm."""


@pytest.fixture(scope="module")
def toolpath():
    path = contour("wavy", 150, 1.0)
    return replace(path, feed=0.0 * path.feed + FAST)


def cell_of(robot=""):
    text = cell_text(STIFFNESS, origin=(1900, 0, 700))
    return parse_cell(text.replace("[tool]", f"{robot}\n[tool]", 1).encode(), "cell.toml")


def times(toolpath, robot):
    """Return the estimate of the plan and that of the text [s], and the files."""
    cell = cell_of(robot)
    job = convert(ConvertRequest("contour", "cell"), toolpath=toolpath, cell=cell)
    modules = parse_files(job.files)
    ran = verify(modules, modules[0].name, cell, toolpath)
    assert ran.ok
    return job.plan.cycle_time, ran.cycle_time, job.files


def test_stated_accelerations_take_time_and_change_no_program(toolpath):
    plain, plain_of_text, files = times(toolpath, "")
    for acceleration, least in ((1e5, 0.999), (60.0, 1.1), (10.0, 2.0)):
        own, of_text, same = times(toolpath, f"accel_deg_s2 = {[acceleration] * 6}")
        assert own >= least * plain
        assert of_text == pytest.approx(own, rel=0.07)  # sampled more coarsely
        assert same == files
    assert plain_of_text == pytest.approx(plain, rel=0.03)


def test_a_lower_jerk_takes_time_on_every_way_from_stop_to_stop(toolpath):
    stated = f"accel_deg_s2 = {[60.0] * 6}"
    soft, _, _ = times(toolpath, f"{stated}\njerk_deg_s3 = {[60.0] * 6}")
    hard, _, _ = times(toolpath, f"{stated}\njerk_deg_s3 = {[6000.0] * 6}")
    assert soft > hard + 0.9  # a second to build the acceleration up, not a hundredth


@pytest.fixture(scope="module")
def heavy(tmp_path_factory):
    """Return a function: efforts of an arm that is a URDF with inertias, to what comes out."""
    folder, short = tmp_path_factory.mktemp("heavy"), contour("wavy", 50, 3.0)

    def run(efforts, robot="", process="", feed=FAST):
        (folder / "arm.urdf").write_text(heavy_urdf(efforts), encoding="utf-8")
        text = cell_text(STIFFNESS, process, tool=WEIGHT, origin=(1900, 0, 700))
        text = re.sub("model = .*", f'urdf = "arm.urdf"\n{robot}', text)
        (folder / "cell.toml").write_text(text, encoding="utf-8")
        cell = load_cell(folder / "cell.toml")
        path = replace(short, feed=0.0 * short.feed + feed)
        job = convert(ConvertRequest("contour", "cell"), toolpath=path, cell=cell)
        modules = parse_files(job.files)
        report = verify(modules, modules[0].name, cell, path)
        assert report.ok
        return job, report, cell

    return run


WEIGHT = "mass_kg = 40\ncog_mm = [0, 0, 200]\n"
NONE, ENOUGH = (0.0,) * 6, (9000.0, 9000.0, 6000.0, 1500.0, 1200.0, 900.0)


@pytest.mark.slow
def test_torques_take_time_and_change_no_program(heavy):
    free, of_text, _ = heavy(NONE)
    assert "torque" not in of_text.worst
    last = free.plan.cycle_time
    for share, waits in ((10.0, False), (1.0, True), (0.6, True)):
        stated = f"torque_nm = {[share * most for most in ENOUGH]}"
        job, ran, _ = heavy(NONE, stated)
        assert job.files == free.files
        assert job.plan.cycle_time == pytest.approx(ran.cycle_time, rel=0.02)
        extra = ran.cycle_time - of_text.cycle_time
        assert ran.worst["torque_time"].value == pytest.approx(extra, abs=1e-9)
        assert (extra > 0.1) == waits
        assert job.plan.cycle_time >= last - 1e-9
        last = job.plan.cycle_time
        assert ran.worst["torque"].value < 100.0
        assert all(warning.code != "torque" for warning in ran.warnings)
    efforts, of_efforts, _ = heavy(tuple(0.6 * most for most in ENOUGH))
    assert efforts.plan.cycle_time == pytest.approx(last)
    assert of_efforts.worst["torque"].value == ran.worst["torque"].value


def test_an_arm_too_weak_for_its_own_weight_is_named(heavy):
    job, ran, cell = heavy(NONE, f"torque_nm = {[0.3 * most for most in ENOUGH]}")
    assert "CEL146" in {finding.code for finding in check_cell(cell).findings}
    [warning] = [warning for warning in ran.warnings if warning.code == "torque"]
    assert "A2 would need" in warning.message
    assert "to stand still" in warning.message
    assert warning.message in {found.message for found in job.findings if found.code == "torque"}


def test_a_force_on_the_tool_is_held_as_its_virtual_work_asks(heavy):
    """So slow that nothing but weights and force counts; turned and moved tools by differences."""
    force, moment = np.array([900.0, -400.0, 1500.0]), np.array([50.0, 80.0, -30.0])
    process = f"[process]\nforce_N = {force.tolist()}\nmoment_Nm = {moment.tolist()}\n"
    _, ran, cell = heavy(ENOUGH, process=process, feed=0.002)
    paths = ran.run.paths
    cuts = np.flatnonzero(paths.trace.is_cp & (paths.trace.column("speed") < 0.0021))
    held = np.isin(paths.row, cuts)
    row = np.r_[paths.row[held], cuts, cuts[0]]
    q = np.vstack([paths.q_sample[held], paths.q[cuts], paths.q[cuts[0] - 1]])
    pushed = row < cuts[-1]  # the last one leads the tool away
    assert np.isfinite(q).all()
    T_flange_tcp, kinematics = cell.tool.T_flange_tcp, build(cell.robot)
    needed = dynamics_of(cell.robot, cell.tool).torques(q, 0.0 * q, 0.0 * q)
    R = (kinematics.fk(q) @ T_flange_tcp)[:, :3, :3]
    for axis, step in enumerate(1e-5 * np.eye(6)):
        after, before = (kinematics.fk(q + side * step) @ T_flange_tcp for side in (1.0, -1.0))
        moved = np.swapaxes(R, 1, 2) @ (after - before)[:, :3, 3:] / 2e-5
        turned = np.swapaxes(R, 1, 2) @ (after - before)[:, :3, :3] / 2e-5
        w = np.column_stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]])
        needed[:, axis] -= pushed * (moved[:, :, 0] @ force + w @ moment)
    share = 100.0 * (np.abs(needed) / np.array(ENOUGH)).max(axis=1)
    # the last row is where the way in begins: the worst place lies between it and the first sample
    assert share[:-1].max() * (1.0 - 1e-3) <= ran.worst["torque"].value
    assert ran.worst["torque"].value <= share.max() * (1.0 + 1e-3) <= 1.02 * share[:-1].max()


def test_torques_without_inertias_are_refused(tmp_path):
    (tmp_path / "arm.urdf").write_text(heavy_urdf(NONE, without=3), encoding="utf-8")
    text = re.sub("model = .*", 'urdf = "arm.urdf"\ntorque_nm = [1, 1, 1, 1, 1, 1]', cell_text())
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8")
    with pytest.raises(CellError) as caught:
        load_cell(tmp_path / "cell.toml")
    assert caught.value.code == "CEL033"
    built_in = re.sub("(model = .*)", r"\1\ntorque_nm = [1, 1, 1, 1, 1, 1]", cell_text())
    with pytest.raises(CellError, match="torque_nm goes with urdf only"):
        parse_cell(built_in.encode(), "cell.toml")


@pytest.mark.parametrize(
    "krl", ["advance = 0", "orientation_speed_deg_s = 2", "path_speed_max_m_s = 0.6"]
)
def test_the_estimate_knows_what_the_head_of_the_program_sets(toolpath, krl):
    text = cell_text(STIFFNESS, f"[krl]\n{krl}\n", origin=(1900, 0, 700))
    cell = parse_cell(text.encode(), "cell.toml")
    job = convert(ConvertRequest("contour", "cell"), toolpath=toolpath, cell=cell)
    modules = parse_files(job.files)
    ran = verify(modules, modules[0].name, cell, toolpath)
    assert ran.ok
    assert job.plan.cycle_time == pytest.approx(ran.cycle_time, rel=0.03)
