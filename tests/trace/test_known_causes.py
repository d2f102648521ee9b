"""Recordings whose cause is known in closed form: named, with its size; and none where none is."""

import json

import numpy as np
import pytest

from postproc.cell import load_cell
from postproc.cli import app
from postproc.jobs.diagnose_trace import diagnose_trace
from postproc.kinematics import build
from postproc.trace.scene import carried
from tests.places import FIXTURES
from tests.trace.known import HEAD, command, place, rows, written

CELL = FIXTURES / "drift_campaign" / "cell.toml"
XYZ = ("x_mm", "y_mm", "z_mm")
LAGS = 1e-3 * np.array([12.0, 7.0, 9.0, -4.0, 15.0, 3.0])


def behind(t):
    """Play of 0.02 degrees at A2: the last motion's sign, of a course that turns round at once."""
    joints = command(t)
    moved = place(t - 0.05)
    sign = np.zeros_like(t)
    step = np.sign(np.round(np.diff(moved, prepend=moved[:1]), 9))
    for k in range(1, len(t)):
        sign[k] = step[k] or sign[k - 1]
    # A2 turns the way of its size
    joints[:, 1] -= 0.02 * sign
    return joints


def ringing(t):
    """A1 swings at 11 Hz for good."""
    joints = command(t)
    joints[:, 0] += 0.004 * np.sin(2 * np.pi * 11.0 * t + 0.4)
    return joints


def second_order(t):
    """All joints behind a loop of second order, integrated in steps of 0.25 ms: 20 ms, 0.8."""
    fine = np.arange(0.0, t[-1] + 1e-9, 2.5e-4)
    goal, w = command(fine), 2 * 0.8 / 0.020
    a, b = goal[0].copy(), np.zeros(6)
    out = np.empty_like(goal)
    for k, x in enumerate(goal):
        out[k] = a
        b += 2.5e-4 * (w * w * (x - a) - 2 * 0.8 * w * b)
        a += 2.5e-4 * b
    # one delay would do for six equal loops: joint 2 has none
    out[:, 1] = goal[:, 1]
    return np.stack([np.interp(t, fine, column) for column in out.T], axis=1)


def resampled(t):
    """The command of 13.7 ms ago, on straight lines between rows: as a record is shifted."""
    return np.stack([np.interp(t - 0.0137, t, column) for column in command(t).T], axis=1)


CAUSES = {
    "none": (command, (), "no_gap"),
    "loop": (second_order, ("servo_lag",), "explained"),
    "delay": (resampled, ("controller_delay",), "explained"),
    "lag": (lambda t: command(t, LAGS), ("servo_lag",), "explained"),
    "play": (behind, ("reversal_error",), "explained"),
    "ringing": (ringing, ("vibration",), "explained"),
    "scale": (
        lambda t: command(t) + [[0, 0.003, 0, 0, 0, 0]] * (command(t) - command(t[:1])),
        (),
        "unexplained",
    ),
}


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    cell = load_cell(CELL)
    folder = tmp_path_factory.mktemp("known")
    documents = {}
    for name, (actual, _, _) in CAUSES.items():
        # play turns within one row, which has to be short against the move
        cycle = 0.004 if name == "play" else 0.008
        log = written(folder / f"{name}.csv", rows(actual, cycle))
        documents[name] = diagnose_trace(log, cell).document
    return documents


def test_each_cause_is_named_and_nothing_else(told):
    wrong = []
    for name, (_, named, verdict) in CAUSES.items():
        got = (tuple(told[name]["adopted"]), told[name]["verdict"])
        if got != (named, verdict):
            wrong.append((name, got))
        likely = [r["name"] for r in told[name]["effects"] if r["probability"] > 0.5]
        if set(likely) - set(named):
            wrong.append((name, "likely", likely))
    assert wrong == []


def parameters(told, name):
    return told["effects"][0]["parameters"] if told["adopted"] == [name] else {}


def test_sizes(told):
    delay = parameters(told["delay"], "controller_delay")["delay_ms"]
    assert delay == pytest.approx(13.7, abs=0.05)
    lag = parameters(told["lag"], "servo_lag")["delay_ms"]
    assert lag == pytest.approx((1e3 * LAGS).tolist(), abs=0.2)
    half = parameters(told["play"], "reversal_error")["half_gap_deg"]
    assert half[1] == pytest.approx(0.02, abs=0.002)
    assert half[0] is None or abs(half[0]) < 1e-4
    swing = parameters(told["ringing"], "vibration")
    assert swing["frequency_Hz"] == pytest.approx(11.0, abs=0.05)


def test_a_copy_of_the_command_is_undetermined(told, tmp_path):
    table = rows(command, 0.012)
    table[:, 7:] = table[:, 1:7]
    copy = diagnose_trace(written(tmp_path / "copy.csv", table), load_cell(CELL)).document
    assert (copy["verdict"], copy["adopted"]) == ("undetermined", [])
    figures = told["delay"]["iso9283"]
    # a delay alone leaves the path where it is
    assert figures["AT_p_mm"] < 0.1 * told["delay"]["gap"]["max_mm"]
    assert (figures["runs"], figures["RT_p_mm"]) == (1, None)


def test_where_a_tracker_sees_nothing_the_gap_is_no_larger(tmp_path):
    cell = load_cell(CELL)
    table = rows(command, 0.008)
    tool = np.asarray(cell.tool.T_flange_tcp[:3, 3])
    point = 1e3 * carried(build(cell.robot), np.deg2rad(table[:, 7:]), tool)
    point += np.random.default_rng(5).normal(0.0, 0.02, point.shape)
    far = place(table[:, 0])
    point += 0.1 * np.sin(10.0 * far)[:, None] * [1.0, 1.0, -1.0]
    point[far > 0.4] = np.nan
    log = written(tmp_path / "log.csv", np.column_stack([table, point]), HEAD, XYZ)
    told = diagnose_trace(log, cell).document
    assert told["verdict"] == "unexplained"
    assert told["gap"]["max_mm"] < 0.3


def tracked(path, late=0.0, shift=0.0):
    """A record with a tracker that stamps its readings late [s]; encoders with much noise."""
    t = np.arange(0.0, 14.5, 0.004)
    draw = np.random.default_rng(7)
    actual = command(t, shift) + draw.normal(0.0, 8e-4, (len(t), 6))
    cell = load_cell(CELL)
    tool = np.asarray(cell.tool.T_flange_tcp[:3, 3])
    point = 1e3 * carried(build(cell.robot), np.deg2rad(command(t - late, shift)), tool)
    point += draw.normal(0.0, 0.01, point.shape)
    return written(path, np.column_stack([t, command(t), actual, point]), HEAD, XYZ)


def test_noise_of_encoders_is_no_clock(tmp_path):
    told = diagnose_trace(tracked(tmp_path / "log.csv"), load_cell(CELL)).document
    assert (told["adopted"], told["verdict"]) == ([], "no_gap")


@pytest.mark.slow
def test_a_late_clock_is_named_and_no_contour_error(tmp_path, capsys):
    on_time = diagnose_trace(tracked(tmp_path / "a.csv", 0.0, LAGS), load_cell(CELL)).document
    log = str(tracked(tmp_path / "b.csv", 0.14, LAGS))
    call = ["diagnose", "--trace", log, "--cell", str(CELL), "--quiet", "--json"]
    assert app.run([*call, "-o", str(tmp_path)]) == 0
    late = json.loads(capsys.readouterr().out)
    assert sorted(late["adopted"]) == ["clock_offset", "servo_lag"]
    sizes = {row["name"]: row["parameters"] for row in late["effects"]}
    assert sizes["clock_offset"]["offset_ms"] == pytest.approx(140.0, abs=0.2)
    for key in ("rms_mm", "left_rms_mm"):
        assert late["contour"][key] == pytest.approx(on_time["contour"][key], rel=0.05)
    # two axes across the path see the tracker's noise
    assert late["contour"]["left_rms_mm"] < 1.1 * np.sqrt(2.0) * 0.01
    assert app.run([*call, "--model", str(tmp_path / "model.toml")]) == 0
    known = json.loads(capsys.readouterr().out)
    assert (known["adopted"], known["verdict"]) == ([], "no_gap")
    left = late["contour"]["left_rms_mm"]
    assert known["contour"]["rms_mm"] == pytest.approx(left, rel=0.05)


@pytest.mark.slow
def test_a_written_model_counts_as_known(tmp_path, capsys):
    log = str(written(tmp_path / "log.csv", rows(lambda t: command(t, LAGS), 0.008)))
    call = ["diagnose", "--trace", log, "--cell", str(CELL), "--quiet", "--json"]
    assert app.run([*call, "-o", str(tmp_path / "out")]) == 0
    first = json.loads(capsys.readouterr().out)
    model = str(tmp_path / "out" / "model.toml")
    assert (tmp_path / "out" / "report.html").stat().st_size > 10_000
    assert app.run([*call, "--model", model]) == 0
    second = json.loads(capsys.readouterr().out)
    assert first["adopted"] == ["servo_lag"]
    assert (second["adopted"], second["verdict"], second["known"]) == ([], "no_gap", ["servo_lag"])
    assert second["gap"]["rms_mm"] < 0.1 * first["gap"]["rms_mm"]


@pytest.mark.parametrize(
    "more", [[], ["--register"], ["--self-check"], ["rows.csv"]], ids=lambda m: " ".join(m)
)
def test_calls_that_mean_nothing(more, tmp_path, capsys):
    table = rows(command)
    log = str(written(tmp_path / "log.csv", table[:, :7], [*("time_s",), *_commands()]))
    assert app.run(["diagnose", "--trace", log, "--cell", str(CELL), *more]) == 2
    assert ("TRC006" if not more else "CLI001") in capsys.readouterr().err


def _commands():
    return [f"q{k}_cmd_deg" for k in range(1, 7)]
