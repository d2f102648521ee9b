"""What a trace has shown is taken off a program: the tool is nearer the path, as was foretold."""

import json
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from postproc.cell import load_cell
from postproc.cli import app
from postproc.compensation import RealArm
from postproc.compensation.along import _rest
from postproc.compensation.drive import _standing
from postproc.errors import DataError, EmitError
from postproc.gap import EFFECTS
from postproc.model import ModelFile, save_model
from postproc.trace import PATH_EFFECTS, known_effects
from tests.places import FIXTURES
from tools.blind.traces.cases import write_case

CELL = FIXTURES / "drift_campaign" / "cell.toml"
LAG = "[effects.servo_lag]\ndelay_ms = [4.0, 22.0, 9.0, 5.0, 12.0, 8.0]\n"
PLAY = (
    "[effects.reversal_error]\nhalf_gap_deg = [0.015, 0.012, 0.0, 0.0, 0.0, 0.0]\n"
    'spike_deg = [0.02, 0.0, 0.0, 0.0, 0.0, 0.0]\nspike_course = "decay"\nspike_s = 0.06\n'
)
LATE = "[effects.controller_delay]\ndelay_ms = 20.0\n"
REST = "[effects.path_rest]\ncontour_rms_mm = 0.01\ncontour_rms_ci_mm = [0.008, 0.013]\n"


def table(text):
    """The table of an effect as a model file has it."""
    return next(iter(tomllib.loads(text)["effects"].values()))


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
    for text, code in (
        (LAG.replace("22.0", "200.0"), "CMP006"),
        (PLAY.replace("0.015", "1e9"), "CMP001"),
        (LAG.replace("22.0", "nan"), "CMP009"),
    ):
        model = tmp_path / "model.toml"
        model.write_text(f'schema = "postproc.model/1"\n{text}')
        call = ["convert", str(source), "--cell", str(CELL), "--model", str(model)]
        app.run([*call, "-o", str(tmp_path)])
        assert code in capsys.readouterr().err


def test_a_delay_of_all_joints_costs_the_part_nothing(told, capsys):
    path, _ = converted(told, "late", capsys)
    assert path["plain_rms_mm"] < 0.005
    assert path["rms_mm"] == path["plain_rms_mm"]


def test_a_shift_answers_what_lasts():
    play = PATH_EFFECTS.get("reversal_error")
    theta = play.read(ModelFile({"reversal_error": table(PLAY)}), table(PLAY))
    stays = play.lasting(theta)
    np.testing.assert_array_equal(stays[:6], theta[:6])
    assert not stays[6:12].any()
    assert not stays[18:24].any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "cause", "keys"),
    [(91, "servo_lag", ["delay_ms"]), (2, "reversal_error", ["half_gap_deg", "spike_deg"])],
)
def test_more_of_what_is_known_is_written_as_one(seed, cause, keys, told, tmp_path, capsys):
    write_case(tmp_path, seed, "single")
    log, cell, program = (str(tmp_path / n) for n in ("log.csv", "cell.toml", "program.src"))
    call = ["diagnose", "--trace", log, "--cell", cell, "--program", program, "--quiet", "--json"]

    def written(folder, *more):
        assert app.run([*call, *more, "-o", str(folder)]) == 0
        assert {cause, "corner_rounding"} <= set(json.loads(capsys.readouterr().out)["adopted"])
        return tomllib.loads((folder / "model.toml").read_text())["effects"]

    whole = written(tmp_path / "whole")
    part = {name: dict(content) for name, content in whole.items()}
    for name, key in ((cause, key) for key in keys):
        part[name][key] = (0.6 * np.array(whole[name][key])).tolist()
    part["corner_rounding"]["cdis_mm"] *= 0.6
    (tmp_path / "part.toml").write_bytes(save_model(ModelFile(part)))
    again = written(tmp_path / "again", "--model", str(tmp_path / "part.toml"))
    assert again["corner_rounding"] == whole["corner_rounding"]
    for key in keys:
        np.testing.assert_allclose(again[cause][key], whole[cause][key], rtol=0.02, atol=1e-3)
    promised = []
    for name in ("whole", "again"):
        model = str(tmp_path / name / "model.toml")
        convert = [model if "both.toml" in word else word for word in told["both"][1]]
        assert app.run([*convert[:-1], str(tmp_path / name)]) == 0
        promised.append(json.loads(capsys.readouterr().out)["compensation"]["along_path"])
    assert promised[1]["plain_rms_mm"] == pytest.approx(promised[0]["plain_rms_mm"], rel=0.02)


HOSTILE = {
    "servo_lag": {
        "delay_ms": (np.inf, 1e9, -1e9, "late", 3.0),
        "time_constant_ms": (-1.0, np.inf, 1e9),
        "loop_damping": (-1.0, 0.0, np.inf),
    },
    "controller_delay": {"delay_ms": (np.nan, np.inf, 1e9, -1e9, "late")},
    "reversal_error": {
        "half_gap_deg": (np.inf, 1e300, "much", 3.0),
        "spike_deg": (np.inf, 1e300, 3.0),
        "spike_course": ("leap", 3.0),
        "spike_s": (np.nan, -1.0, 0.0, 1e9, "long"),
        "delay_ms": (np.nan, -1.0, 1e9),
        "back_deg": (np.nan, np.inf, "far"),
    },
    "path_rest": {
        "contour_rms_mm": (np.nan, -1.0, np.inf),
        "contour_rms_ci_mm": ([0.0, np.nan], [-1.0, 1.0], 3.0),
    },
}
"""What no arm has, by effect and key; one number for six joints stands for six of it."""


def test_numbers_that_no_arm_has_are_refused_and_joints_unseen_are_told():
    good = {name: table(text) for name, text in zip(HOSTILE, (LAG, LATE, PLAY, REST), strict=True)}
    # half a degree of lead in one joint is odd, and an arm's
    accepted = []
    for name, keys in HOSTILE.items():
        for key, values in keys.items():
            six = isinstance(good[name].get(key, [0.0] * 6), list) and name != "path_rest"
            for value in values:
                many = six and isinstance(value, float) and value != 3.0
                wrong = {**good, name: good[name] | {key: [value] * 6 if many else value}}
                try:
                    _rest(ModelFile(wrong))
                    known_effects(ModelFile(wrong))
                    accepted.append((name, key, value))
                except DataError as refused:
                    accepted += [(name, key, value)] if refused.code != "MOD006" else []
    assert accepted == []
    blind = good["servo_lag"] | {"delay_ms": [1.0, np.nan, 2.0, 3.0, np.nan, 4.0]}
    assert ModelFile({"servo_lag": blind}).unseen == {"servo_lag.delay_ms": [2, 5]}


def test_static_numbers_that_no_arm_has_are_refused():
    arm, accepted = RealArm.of(load_cell(CELL), ModelFile({})).model.arm, []
    for name, effect in EFFECTS:
        shapes = {k: (n if isinstance(n, tuple) else (n,) * (n > 1)) for k, n in effect.layout}
        shapes |= dict.fromkeys(effect.setting_keys.values(), ())
        for key, shape in shapes.items():
            for value in (np.nan, np.inf, -np.inf, 1e300, "much"):
                if (shape == (6,) and value is np.nan) or ("stiffness" in key and value == np.inf):
                    continue
                others = {k: np.ones(n).tolist() for k, n in shapes.items()}
                wrong = others | {key: np.full(shape, value).tolist()}
                try:
                    effect.read(ModelFile({name: wrong}, instrument={}), arm)
                    accepted.append((name, key, value))
                except DataError:
                    pass
    assert accepted == []


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
