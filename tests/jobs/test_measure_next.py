"""The next measurements: what they promise is what they deliver once they are taken."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.cell import MeshPlacement
from postproc.cell.file import load_cell
from postproc.cli.app import run
from postproc.collision.scene import Scene
from postproc.gap.answers.diagnose import diagnose
from postproc.gap.answers.next_pose import Reach
from postproc.gap.answers.next_poses import (
    Question,
    candidates,
    discriminating,
    next_poses,
    questions,
    reassessed,
)
from postproc.gap.fit.problem import pose_problem
from postproc.gap.posterior.chosen import free_of
from postproc.gap.posterior.evidence import optimum
from postproc.gap.posterior.final import Named
from postproc.jobs.measure_next import NextMeasurements, csv_text, measure_next
from postproc.kinematics import build
from postproc.measurement.campaign import read_campaign
from postproc.measurement.file import read_measurements
from tests.gap import synthetic
from tests.places import PANEL_CELL

NOISE = 2e-5


@pytest.fixture(scope="module")
def world():
    """The made-up robot of the gap tests: formulas of its own."""
    return synthetic


@pytest.fixture(scope="module")
def cell():
    return load_cell(PANEL_CELL)


class Campaign:
    """A narrow campaign of a robot with one cause, and the readings that are asked for."""

    def __init__(self, world, seed, name, span, leave_out=()):
        self.world, self.rng, self.leave_out = world, np.random.default_rng(seed), leave_out
        self.data = world.campaign(self.rng, 70, 10, span)
        world.campaign(self.rng, 200, 5, span)
        put = world.effect(name, self.rng)
        self.truth = world.Truth()
        put(self.truth, world.scaled(put, self.data, 1e-4))
        self.points = self.read(self.data)

    def read(self, data):
        return self.world.solve(self.truth, data) + self.rng.normal(0, NOISE, (len(data["q"]), 3))

    def write(self, path):
        path.write_text(self.world.csv(self.data, self.points, self.leave_out))
        return path

    def fill(self, plan, path):
        """Take the readings of a plan, as somebody with a tracker would."""
        remarks = [line for line in plan.read_text().splitlines() if line.startswith("#")]
        lines = plan.read_text().splitlines()[len(remarks) :]
        rows = list(csv.DictReader(lines))

        def columns(names):
            return np.array([[float(row[name] or 0.0) for name in names] for row in rows])

        later = self.data["time"][-1] + 60.0 * (1.0 + np.arange(len(rows)))
        data = {
            "q": np.radians(columns([f"q{i}_deg" for i in range(1, 7)])),
            "wrench": columns(["fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm"]),
            "direction": columns([f"dir{i}" for i in range(1, 7)]),
            "qd": np.radians(columns([f"qd{i}_deg_s" for i in range(1, 7)])),
            "time": later,
            "temp": np.full(len(rows), self.data["temp"][-1]),
        }
        both = {k: np.concatenate([self.data[k], data[k]]) for k in data}
        points = self.read(both)[len(self.points) :]
        for row, point, time, temp in zip(rows, points, later, data["temp"], strict=True):
            x, y, z = (f"{1e3 * v:.5f}" for v in point)
            row |= {"x_mm": x, "y_mm": y, "z_mm": z}
            row |= {"time_s": f"{time:.1f}", "temp_C": f"{temp:.2f}"}
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)
        return points, columns(["expected_x_mm", "expected_y_mm", "expected_z_mm"]) / 1e3


def refuted(later, first, question, true):
    """Return by how many sigma readings speak against the best rival, beyond those before."""
    gap = []
    for problem in (first.problem, later):
        rows = np.ones(len(problem), dtype=bool)
        square = []
        of = first.judged.posterior
        for model in question.models:
            at = optimum(of.search.equations, model, of.prior, first.judged.whole)
            keys = [k for k in model if k not in of.search.always]
            beside = np.zeros((len(problem), 3))
            fit = Named.of(problem, free_of(of, keys, at), first.noise, rows, beside)
            points = fit.fit.point
            square.append(float(np.sum(((problem.measured - points) / first.noise) ** 2)))
        gap.append(np.array(square) - square[question.names.index(true)])
    grown = np.delete(gap[1] - gap[0], question.names.index(true))
    return float(np.sqrt(max(grown.min(), 0.0)))


CLEARLY = 6.0
"""A separation [sigma] after which there is no doubt left."""
CASES = [
    (101, "payload_error", 0.15),
    (72, "joint_compliance", 0.05),
]


@pytest.fixture(scope="module")
def ambiguous(world, cell, tmp_path_factory):
    """The first of some narrow campaigns whose cause cannot be told yet, but could be."""
    folder = tmp_path_factory.mktemp("ambiguous")
    for seed, name, span in CASES:
        campaign = Campaign(world, seed, name, span)
        path = campaign.write(folder / f"{name}.csv")
        diagnosis = diagnose(pose_problem(read_measurements(path), build(cell.robot), cell))
        for question in questions(diagnosis):
            asked = name in question.names and name in diagnosis.adopted
            if (
                asked
                and discriminating(diagnosis, question, Reach())[0].separations[name] > CLEARLY
            ):
                return diagnosis, path, name, campaign
    raise AssertionError("no campaign is ambiguous")


@pytest.fixture(scope="module")
def asking(ambiguous, tmp_path_factory):
    """Folder and document of the command that looks at these."""
    out = tmp_path_factory.mktemp("asking")
    with contextlib.redirect_stdout(io.StringIO()) as said:
        call = ["diagnose", str(ambiguous[1]), "--cell", str(PANEL_CELL), "-o", str(out)]
        assert run([*call, "--json"]) == 0
    return out, json.loads(said.getvalue())


def test_a_set_is_resolved_by_what_was_asked_for(ambiguous, asking, tmp_path, capsys):
    _, path, name, campaign = ambiguous
    (out, before), filled = asking, tmp_path / "next.csv"
    assert any(item["confounded_with"] for item in before["effects"] if item["adopted"])
    asked = [item for item in before["next_measurements"] if name in item["why"]]
    assert asked
    promise = asked[0]["separation_if_sigma"]
    assert asked[0]["separation_sigma"] == min(promise.values())
    assert promise[name] > CLEARLY
    points, expected = campaign.fill(out / "next_measurements.csv", filled)
    # near enough to find the place, not equal: it is what is to be measured
    assert np.linalg.norm(points - expected, axis=1).max() < 1e-3
    assert run(["diagnose", str(path), str(filled), "--cell", str(PANEL_CELL), "--json"]) == 0
    after = json.loads(capsys.readouterr().out)
    assert after["adopted"] == [name]
    assert after["verdict"] == "explained"
    assert not set(after["effects"][0]["confounded_with"]) & set(promise)
    assert after["rows"]["total"] == 70 + len(before["next_measurements"])


@pytest.mark.parametrize(
    ("seed", "name", "span", "rivals"),
    [
        (61, "joint_offset", 0.08, ("gravity_sag", "payload_error")),
        (100, "counterbalance", 0.15, ("payload_error",)),
        (101, "joint_compliance", 0.08, ("link_bending",)),
    ],
)
def test_promised_and_delivered(world, cell, tmp_path, seed, name, span, rivals):
    campaign = Campaign(world, seed, name, span)
    path, filled = campaign.write(tmp_path / "first.csv"), tmp_path / "next.csv"
    kinematics = build(cell.robot)
    first = diagnose(pose_problem(read_measurements(path), kinematics, cell))
    names = (name, *rivals)
    question = Question(tuple((key,) for key in names), names, names)
    asked = NextMeasurements(tuple(discriminating(first, question, Reach())), np.zeros((0, 6)), ())
    plan = tmp_path / "plan.csv"
    plan.write_bytes(csv_text(asked, first.problem.measurements, {}))
    campaign.fill(plan, filled)
    both = pose_problem(read_campaign([path, filled]), kinematics, cell)
    promise = asked.poses[0].separations[name]
    assert promise > 4.0
    # a sigma of the readings to come; what the first rows leave open of the numbers only adds
    got = refuted(both, first, question, name)
    assert 0.85 * promise - 3.0 < got < 2.0 * promise + 3.0


def test_poses_tell_more_than_random_ones_of_the_same_region(ambiguous):
    diagnosis = ambiguous[0]
    poses = next_poses(diagnosis)
    pool = candidates(diagnosis, questions(diagnosis)[0].effects, Reach())
    rng = np.random.default_rng(4)
    chance = []
    for _ in range(8):
        some = [
            replace(poses[0], q=pool.q[k], wrench=pool.wrench[k], direction=pool.direction[k])
            for k in rng.choice(len(pool), len(poses), replace=False)
        ]
        chance.append(reassessed(diagnosis, some)[0].separation)
    assert poses[0].separation > 1.2 * max(chance)
    # fewer readings never tell more
    assert reassessed(diagnosis, poses[:6])[0].separation < poses[0].separation


def test_every_move_is_free_and_every_pose_inside_the_limits(ambiguous, cell):
    found = measure_next(ambiguous[0], cell)
    kinematics = build(cell.robot)
    margin = cell.limits.joint_margin
    q = np.array([pose.q for pose in found.poses])
    assert np.all(q > cell.robot.q_min + margin)
    assert np.all(q < cell.robot.q_max - margin)
    assert np.all(np.abs(q[:, 4]) >= cell.limits.singularity)
    steps = np.linspace(0.0, 1.0, 60)[:, None, None]
    ways = found.q[None, :-1] + steps * np.diff(found.q, axis=0)[None]
    scene = Scene.build(cell, kinematics)
    assert not np.any(scene.check(ways.reshape(-1, 6)).hit)
    assert sorted(k for k in found.reads if k >= 0) == list(range(len(found.poses)))


def test_an_obstacle_keeps_poses_away(ambiguous, cell):
    free = measure_next(ambiguous[0], cell)
    points = np.array([pose.expected for pose in free.poses])
    place = np.eye(4)
    place[:3, 3] = points[np.argmax(points[:, 1])]
    box = MeshPlacement("cabinet", place, size=np.full(3, 0.6))
    walled = replace(cell, obstacles=(*cell.obstacles, box))
    scene = Scene.build(walled, build(walled.robot))
    assert np.any(scene.check(np.array([pose.q for pose in free.poses])).hit)
    found = measure_next(ambiguous[0], walled)
    assert found.poses
    assert not np.any(scene.check(np.array([pose.q for pose in found.poses])).hit)


def test_the_program_comes_from_the_proposed_side_and_halts(asking):
    out, _ = asking
    text = (out / "next_measurements.src").read_text()
    rows = list(csv.DictReader((out / "next_measurements.csv").read_text().splitlines()[4:]))
    number = r"A\d (-?[\d.]+)"
    moves = re.findall(rf"PTP {{{','.join([number] * 6)}}}.*\n(HALT ; .*take the reading)?", text)
    q = np.array([[float(v) for v in move[:6]] for move in moves])
    read = [k for k, move in enumerate(moves) if move[6]]
    assert len(read) == len(rows)
    for row, k in zip(rows, read, strict=True):
        commanded = [float(row[f"q{i}_deg"]) for i in range(1, 7)]
        side = [int(row[f"dir{i}"]) for i in range(1, 7)]
        np.testing.assert_allclose(q[k], commanded, atol=1e-5)
        np.testing.assert_array_equal(np.sign(np.round(q[k] - q[k - 1], 6)), side)
    loads = [row["fx_N"] for row in rows]
    changes = sum(a != b for a, b in zip(["0.000", *loads], loads, strict=False))
    assert len(re.findall(r"HALT ; .*put on load", text)) == changes
    assert "CAM line 6" in text.split("take the reading")[0]
    assert run(["lint", str(out / "next_measurements.src")]) == 0
    assert run(["verify", str(out / "next_measurements.src"), "--cell", str(PANEL_CELL)]) == 0


def test_a_table_with_readings_is_never_overwritten(ambiguous, asking, tmp_path, capsys):
    path = ambiguous[1]
    out = tmp_path / "out"
    shutil.copytree(asking[0], out)
    call = ["diagnose", str(path), "--cell", str(PANEL_CELL), "-o", str(out), "--quiet"]
    plan = out / "next_measurements.csv"
    assert run(call) == 0
    lines = plan.read_text().splitlines()
    lines[6] = lines[6].replace(",,,", ",1.0,2.0,3.0,", 1)
    plan.write_text("\n".join(lines))
    capsys.readouterr()
    assert run(call) == 2
    assert f"{plan}:7: error GAP005" in capsys.readouterr().err.splitlines()[0]
    assert plan.read_text() == "\n".join(lines)


def test_an_unfilled_table_is_refused_with_its_line(ambiguous, asking, capsys):
    path = ambiguous[1]
    plan = str(asking[0] / "next_measurements.csv")
    assert run(["diagnose", str(path), plan, "--cell", str(PANEL_CELL)]) == 2
    assert f"{plan}:6: error MEA007: the row reads nothing" in capsys.readouterr().err


def test_play_that_nobody_logged_is_asked_for_from_both_sides(world, cell, tmp_path):
    campaign = Campaign(world, 45, "backlash", 1.0, ("direction",))
    rows = read_measurements(campaign.write(tmp_path / "rows.csv"))
    diagnosis = diagnose(pose_problem(rows, build(cell.robot), cell))
    assert diagnosis.verdict == "unexplained"
    poses = [pose for pose in next_poses(diagnosis, Reach()) if "both sides" in pose.why]
    sides = {tuple(np.round(pose.q, 9)): [] for pose in poses}
    for pose in poses:
        sides[tuple(np.round(pose.q, 9))].append(float(pose.direction[0]))
    assert poses, "beside poses that tell other causes apart"
    assert all(sorted(both) == [-1.0, 1.0] for both in sides.values())


def test_where_the_rest_is_largest_is_measured_again(world, cell, tmp_path):
    campaign = Campaign(world, 43, "step", 1.0)
    rows = read_measurements(campaign.write(tmp_path / "rows.csv"))
    diagnosis = diagnose(pose_problem(rows, build(cell.robot), cell))
    assert diagnosis.verdict == "unexplained"
    poses = [pose for pose in next_poses(diagnosis, Reach()) if not pose.separations]
    assert poses
    size = np.linalg.norm(diagnosis.residual, axis=1)
    for pose in poses:
        same = np.abs(rows.q - pose.q).max(axis=1) < 1e-9
        assert size[same].max() > np.median(size)
        assert pose.temperature is None
        assert not [name for name in ("position", "neighbouring", "q2") if name in pose.why]


def test_nothing_is_asked_where_nothing_is_in_doubt(world, cell, tmp_path):
    campaign = Campaign(world, 61, "backlash", 1.0)
    rows = read_measurements(campaign.write(tmp_path / "rows.csv"))
    diagnosis = diagnose(pose_problem(rows, build(cell.robot), cell))
    assert diagnosis.verdict == "explained"
    assert measure_next(diagnosis, cell).poses == ()
