"""What a trace has shown is taken off a program: the tool is nearer the path, as was foretold."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from postproc.cell import load_cell
from postproc.cli import app
from postproc.compensation.along import _held
from postproc.compensation.drive import _standing
from postproc.errors import EmitError
from tests.places import FIXTURES

CELL = FIXTURES / "drift_campaign" / "cell.toml"
LAG = "[effects.servo_lag]\ndelay_ms = [4.0, 22.0, 9.0, 5.0, 12.0, 8.0]\n"
PLAY = (
    "[effects.reversal_error]\nhalf_gap_deg = [0.015, 0.012, 0.0, 0.0, 0.0, 0.0]\n"
    'spike_deg = [0.02, 0.0, 0.0, 0.0, 0.0, 0.0]\nspike_course = "decay"\nspike_s = 0.06\n'
)
LATE = "[effects.controller_delay]\ndelay_ms = 20.0\n"
REST = "[effects.path_rest]\ncontour_rms_mm = 0.01\ncontour_rms_ci_mm = [0.008, 0.013]\n"


def contour():
    """A corner, a long straight and a half circle: joints turn round on it."""
    angle = np.linspace(0.0, np.pi, 25)
    arc = np.stack([60.0 + 25.0 * np.sin(angle), 45.0 - 25.0 * np.cos(angle)], axis=1)
    at = [[0.0, 0.0], [60.0, 0.0], *arc.tolist(), [0.0, 70.0]]
    words = [f"GOTO/{x:.4f},{y:.4f},0" for x, y in at]
    head = ["PARTNO/LOOP", "UNITS/MM", "LOADTL/1", "RAPID", "GOTO/0,0,50,0,0,1"]
    return "\n".join([*head, "FEDRAT/4000,MMPM", *words, "RAPID", "GOTO/0,70,50", "FINI"]) + "\n"


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loop")
    source = folder / "loop.apt"
    source.write_text(contour())
    found = {}
    for name, tables in (("both", LAG + PLAY + REST), ("late", LATE)):
        model = folder / f"{name}.toml"
        model.write_text('schema = "postproc.model/1"\n' + tables)
        call = ["convert", str(source), "--cell", str(CELL), "--model", str(model), "--quiet"]
        found[name] = (folder / name, [*call, "--json", "-o", str(folder / name)])
    return found


def converted(told, name, capsys):
    folder, call = told[name]
    assert app.run(call) == 0
    answer = json.loads(capsys.readouterr().out)
    return answer["compensation"]["along_path"], (folder / "LOOP.src", folder)


def test_lag_and_play_are_taken_off(told, capsys):
    path, _ = converted(told, "both", capsys)
    assert path["effects"] == ["reversal_error", "servo_lag"]
    assert path["plain_rms_mm"] > 0.1
    assert path["rms_mm"] < path["plain_rms_mm"] / 3.0
    assert path["max_mm"] <= path["plain_max_mm"]
    low, high = path["expected_rms_ci_mm"]
    assert low <= path["expected_rms_mm"] <= high


def test_what_is_left_beyond_a_corner_is_said_and_a_model_of_no_arm_refused(told, tmp_path, capsys):
    source = told["both"][0].parent / "loop.apt"
    for delay, code in ((200.0, "CMP006"), (3000.0, "CMP001")):
        model = tmp_path / "model.toml"
        table = f"[effects.servo_lag]\ndelay_ms = [0.0, {delay}, 0.0, 0.0, 0.0, 0.0]\n"
        model.write_text(f'schema = "postproc.model/1"\n{table}')
        call = ["convert", str(source), "--cell", str(CELL), "--model", str(model)]
        app.run([*call, "-o", str(tmp_path)])
        assert code in capsys.readouterr().err


def test_a_delay_of_all_joints_costs_the_part_nothing(told, capsys):
    path, _ = converted(told, "late", capsys)
    assert path["plain_rms_mm"] < 0.005
    assert path["rms_mm"] == path["plain_rms_mm"]


def test_a_shifted_joint_goes_no_further_than_where_it_turns():
    time = np.linspace(-1.0, 1.0, 41)
    q = np.zeros((41, 6))
    q[:, 1] = -(time**2)
    shifted = q + 0.05 * np.where(time <= 0.0, 1.0, -1.0)[:, None]
    held = _held(q, shifted, np.ones(41, dtype=bool), np.array([1]))
    # no play of 0.05 is crossed before the turn: the joint waits there
    step = np.diff(held[:, 1])
    assert np.all(step[:20] >= 0.0)
    assert np.all(step[20:] <= 0.0)
    np.testing.assert_array_equal(held[time < -0.25, 1], shifted[time < -0.25, 1])
    np.testing.assert_array_equal(held[:, 0], shifted[:, 0])


def test_external_axes_that_move_in_the_cut_are_refused():
    rail = np.array([[0.0], [0.0], [0.1]])
    cell = load_cell(CELL)
    for last, is_refused in ((True, True), (False, False)):
        cp = SimpleNamespace(is_cp=np.array([False, True, last]))
        paths = SimpleNamespace(external=rail, trace=cp)
        if is_refused:
            with pytest.raises(EmitError, match="external axes move in 1 path motions"):
                _standing(paths, cell)
        else:
            _standing(paths, cell)


def test_standing_poses_are_foretold_without_what_belongs_to_motion(tmp_path, capsys):
    model, rows = tmp_path / "model.toml", CELL.parent / "measured.csv"
    model.write_text('schema = "postproc.model/1"\n' + LATE + PLAY + REST)
    answers = []
    for more in ((), ("--model", str(model))):
        call = ["predict", str(rows), "--cell", str(CELL), "-o", str(tmp_path / "out.csv")]
        assert app.run([*call, *more, "--json"]) == 0
        answers.append(json.loads(capsys.readouterr().out))
    assert answers[1]["left_out"] == ["controller_delay", "reversal_error"]
    assert answers[1]["rms_mm"] == answers[0]["rms_mm"]
