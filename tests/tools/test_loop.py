"""Compensated programs on hidden robots: bounded, without steps, better on every stretch.

The programs are read, driven and judged by ``tools.blind`` alone: its own reader of KRL, its own
arm in screws, gears that cross their gaps, springs in equilibrium.
"""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.compensation.real_arm import RealArm
from postproc.jobs.convert import Conversion, ConvertRequest, convert
from postproc.kinematics import build
from postproc.krl import parse_files
from postproc.model import MoveRole, load_model
from postproc.paths import joint_paths, run_in_cell
from postproc.paths.moments import Moments
from tests.places import ROOT
from tools.blind import loop
from tools.blind.__main__ import main
from tools.blind.beyond import make
from tools.blind.effects import LIBRARY
from tools.blind.program import drive_program, read_krl
from tools.blind.robots import KR500, model_text
from tools.blind.world import Hidden

STEEPEST = 0.2
"""As documented: so much may the path of the commands change per way of a cut."""
SLOT = ROOT / "fixtures" / "compensated"


def test_the_reader_of_its_own_drives_as_the_interpreter_does() -> None:
    cell = load_cell(SLOT / "cell.toml")
    path = SLOT / "expected" / "slot.src"
    tool, base = np.array(cell.tool.T_flange_tcp), np.array(cell.workpiece.T_robroot_base)
    run = drive_program(read_krl(path), KR500.arm, base, tool)
    assert [c.kind for c in run.commands] == ["PTP", "LIN", "LIN", "LIN", "CIRC", "LIN", "LIN"]
    files = {name.name: name.read_bytes() for name in (SLOT / "expected").iterdir()}
    kinematics = build(cell.robot)
    ours = joint_paths(run_in_cell(parse_files(files), "slot", cell, kinematics), cell, kinematics)
    np.testing.assert_allclose(run.q[run.ends], ours.q[-7:], atol=2e-7)
    at = ours.curves.flange(np.array([len(ours) - 3]), np.array([0.5]), ours.station.externals,
                            ours.external)  # fmt: skip
    way = (np.linalg.inv(base) @ at @ tool)[0, :3, 3]
    arc = run.point[run.command == 4]
    assert np.linalg.norm(arc - way, axis=1).min() < 1e-4
    assert run.speed[run.ends[1]] == pytest.approx(0.01)


def test_a_motion_that_the_reader_does_not_know_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.src").write_text("DEF a()\nSLIN {X 1,Y 2,Z 3,A 0,B 0,C 0}\nEND\n")
    with pytest.raises(ValueError, match="SLIN"):
        read_krl(tmp_path / "a.src")


def a_job(number: int, seed: int) -> tuple[loop.Job, str]:
    """Return a case with springs, soft backlash and friction, and what a model knows of it."""
    job = loop.draw(number, seed)
    rng = np.random.default_rng([seed, number])
    half, dry = rng.uniform(0.3e-4, 2.5e-4, 6), rng.uniform(0.0, 0.4e-4, 6)
    factor = np.exp(rng.normal(0.0, 0.25, 6))
    numbers = {
        "joint_compliance": {"factor": factor, "hardening": np.array([0.04])},
        "backlash": {"half": half, "soft": np.array([2.2])},
        "windup": {
            **{"dry": dry, "loaded": np.full(6, 0.8)},
            **{"fades": np.array([0.4]), "after": np.array([4.0])},
        },
    }
    windup = make("windup", rng, job.robot, loop.poses(job.robot, rng)).change
    change = {"windup": windup} | {name: LIBRARY[name].change for name in [*numbers][:2]}
    hidden = tuple(Hidden(name, x, 1.0, change[name]) for name, x in numbers.items())
    known = np.rad2deg(half + 1.3 * dry)
    model = model_text(1.0 / (factor * job.robot.arm.give)) + (
        "[effects.backlash]\nhalf_gap_deg = [" + ", ".join(f"{v:.7f}" for v in known) + "]\n"
    )
    first, *rest = model.splitlines()
    return replace(job, hidden=hidden), "\n".join([first, "has_tool_weight = true", *rest]) + "\n"


def made(job: loop.Job, folder: Path, model: Path | None) -> tuple[Conversion, loop.Driven]:
    """Return the program of a job, and what the hidden robot does with it."""
    (folder / "cell.toml").write_text(loop.cell_of(job))
    source = folder / job.source[0]
    source.write_text(job.source[1])
    name = None if model is None else str(model)
    done = convert(ConvertRequest(str(source), str(folder / "cell.toml"), model=name))
    assert done.files, [str(finding) for finding in done.findings]
    for file, content in done.files.items():
        (folder / file).write_bytes(content)
    return done, loop.driven(job, folder / f"{done.name}.src")


def expected_gaps(done: Conversion, folder: Path) -> np.ndarray:
    """Return the displacement (64, m, 3) with each joint on either side, at the shifted poses."""
    plan, cell = done.plan, load_cell(folder / "cell.toml")
    arm = RealArm.of(cell, load_model(folder / "model.toml"))
    working = np.isin(plan.role, (MoveRole.CUT, MoveRole.PLUNGE))[:, None]
    q, process = np.asarray(plan.q), working * cell.process.wrench_tcp
    still = np.zeros_like(q)
    return np.array([
        arm.displacement(Moments(q, still, np.tile(np.array(side), (len(q), 1)), process))
        for side in itertools.product([-1.0, 1.0], repeat=6)
    ])  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("number", "seed"), [(2, 3), (4, 9), (10, 9)])
def test_compensation_is_bounded_smooth_and_better_on_every_stretch(
    tmp_path: Path, number: int, seed: int
) -> None:
    job, model = a_job(number, seed)
    (tmp_path / "model.toml").write_text(model)
    first = made(job, tmp_path, None)[1]
    done, second = made(job, tmp_path, tmp_path / "model.toml")
    plan = done.plan
    shift = np.asarray(plan.compensation)
    gaps = expected_gaps(done, tmp_path)
    most = np.linalg.norm(gaps, axis=2).max(axis=0)
    assert np.all(np.linalg.norm(shift, axis=1) <= most + 1e-6)
    got = loop.compared(job, first, second)
    assert got["rms_after_mm"] < 0.35 * got["rms_before_mm"]
    if job.kind == "milling":
        cut = np.asarray(plan.role) == MoveRole.CUT
        aimed = np.asarray(plan.T_base_tcp)[:, :3, 3] - shift
        onward = np.linalg.norm(np.diff(aimed, axis=0), axis=1) > 1e-9
        # where the cut starts gears cross their gaps, the tool stands: nowhere else
        crossing = np.flatnonzero(~onward & cut[1:])
        assert {1} <= set(plan.tag[crossing + 1].tolist()) <= {0, 1}
        both = cut[1:] & cut[:-1] & onward
        moving = (shift + gaps.mean(axis=0))[1:] - (shift + gaps.mean(axis=0))[:-1]
        way = np.linalg.norm(np.diff(np.asarray(plan.T_base_tcp)[:, :3, 3], axis=0), axis=1)
        assert np.all(np.linalg.norm(moving, axis=1)[both] <= 1.1 * STEEPEST * way[both] + 1e-6)
        # soft flanks and friction are not in the model: by 0.02 mm it may be off
        assert got["worst_stretch_mm"] < 0.02
        assert got["worse_stretches"] <= 0.05 * got["stretches"]
        before, after = (np.linalg.norm(d.real[d.at] - job.points, axis=1) for d in (first, second))
        assert after[0] < 0.25 * before[0]
    else:
        before, after = (np.linalg.norm(d.real[d.at] - job.points, axis=1) for d in (first, second))
        assert np.all(after < before)


@pytest.mark.slow
def test_the_loop_closes_through_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["loop", "-o", str(tmp_path), "--cases", "2", "--seed", "1"]) == 0
    assert "| promised |" in capsys.readouterr().out
    for case in json.loads((tmp_path / "loop.json").read_text())["cases"]:
        told = case["product"]
        assert case["rms_after_mm"] < 0.15 * case["rms_before_mm"]
        assert told["shrinkage"] == pytest.approx(told["promised"], abs=0.08)
        assert case.get("worse_stretches", 0) == 0
