"""What effects declare of each other; no other file has the name of one."""

import re
from pathlib import Path

import numpy as np

import postproc
from postproc.gap import EFFECTS
from postproc.gap.effect import State
from postproc.gap.robot_model import effect_of
from postproc.model import ModelFile
from postproc.registry import part_names

SOURCE = Path(postproc.__file__).parent
ALL = [effect for _, effect in EFFECTS]


def test_every_public_name_is_there():
    public = """
        base_frame tool_frame joint_offset link_geometry joint_compliance gravity_sag
        variable_stiffness backlash transmission_error thermal_drift servo_lag gear_coupling
        payload_error counterbalance set_up_frames encoder_scale bearing_runout
        angle_error load_creep tracker_creep reflector_creep tool_frames fixture_frames rail
    """
    assert set(public.split()) == {e.name for e in ALL if not e.is_alternative}


def test_names_are_known_without_importing_an_effect():
    assert part_names("effects", "postproc.gap.effects") == tuple(e.name for e in ALL)


def test_what_an_effect_declares_of_others_is_there():
    names = {effect.name for effect in ALL}
    for effect in ALL:
        assert {*effect.refines} <= names - {effect.name}


def test_no_other_file_has_the_name_of_an_effect():
    """What others must know of an effect it declares itself."""
    names = "|".join(e.name for e in ALL if e.name != "rail")  # a word of cells, too
    quoted = re.compile(rf"""["'`](?:{names})["'`]""")
    found = [
        f"{path.relative_to(SOURCE)}: {match[0][1:-1]}"
        for path in SOURCE.rglob("*.py")
        if not any(path.is_relative_to(SOURCE / room / "effects") for room in ("gap", "trace"))
        for match in quoted.finditer(path.read_text(encoding="utf-8"))
    ]
    # variables of the program template and a function that have the words of an effect
    others = {"emitters/kuka/setup.py: tool_frame", "emitters/kuka/setup.py: base_frame"}
    assert set(found) <= others | {"stiffness/__init__.py: joint_compliance"}


def test_a_fitted_table_of_angles_holds_no_mean_and_no_period_per_turn(samples):
    effect = effect_of("angle_error")
    setting = effect.prepare(samples)
    joint = np.array(setting["joint"]) - 1
    angle = np.deg2rad(np.array(setting["knot"]) * np.array(setting["step_deg"])[joint])
    turn = effect.basis(samples, setting).joint
    low = np.column_stack([np.ones(len(angle)), np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(turn @ low, 0.0, atol=1e-12)
    wave = turn @ np.cos(6.0 * angle)
    assert np.sqrt(np.mean(wave**2)) > 0.1


def test_a_table_of_angles_in_a_file_is_taken_as_it_is(samples):
    effect = effect_of("angle_error")
    setting = effect.prepare(samples)
    theta = np.full(len(setting["knot"]), 1e-3)
    table = effect.write(State(theta, setting), samples.arm)
    assert table.pop("periods_left_out") == [0, 1]
    state = effect.read(ModelFile({effect.name: table}), samples.arm)
    moved = effect.basis(samples, state.setting).joint @ state.theta
    np.testing.assert_allclose(moved, 1e-3, rtol=1e-6)
