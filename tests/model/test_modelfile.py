"""``model.toml``: round trips, units at the border, complaints with line and nearest name."""

import math
import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from postproc.errors import DataError, ReadError
from postproc.geometry.frames import transform_from_kuka
from postproc.model.modelfile import (
    ModelFile,
    Registration,
    entry,
    factor,
    load_model,
    save_model,
    si,
)
from postproc.toml.edit import toml_key, toml_value

CONTRACT = """schema = "postproc.model/1"
[effects.joint_compliance]
stiffness_Nmm_per_rad = [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]
[effects.joint_offset]
offset_deg = [0, 0.012, 0, 0, 0.02, 0]
"""


def load(tmp_path, text):
    path = tmp_path / "model.toml"
    path.write_text(text, encoding="utf-8")
    return load_model(path)


def test_the_contracts_example(tmp_path):
    model = load(tmp_path, CONTRACT)
    k = model.values("joint_compliance", "stiffness_Nmm_per_rad", (6,))
    np.testing.assert_allclose(k, [1.58e7, 6.12e6, 5.28e6, 4.66e5, 2.19e5, 3.49e5])
    offset = model.values("joint_offset", "offset_deg", (6,))
    assert offset[4] == pytest.approx(math.radians(0.02))
    assert model.registration is None


def test_round_trip_keeps_bytes_and_numbers(tmp_path):
    registration = Registration(
        transform_from_kuka([3000.1, -5, 0.123456789], [40, 3, -2]), np.array([0.1, 0, 0.362]), 2e-5
    )
    effects = {
        "joint_offset": {"offset_deg": [0.1, math.nan, -0.0]},
        "own effect": {"table": [[1, 2.5], [math.inf, -1e-300]], "on": True, "name": 'a "b"\n\\c'},
        "empty": {},
    }
    text = save_model(ModelFile(effects, registration, ("first", "zweite Notiz: ä")))
    back = load(tmp_path, text.decode())
    assert save_model(back) == text
    assert back.notes == ("first", "zweite Notiz: ä")
    assert back.effects["own effect"]["name"] == 'a "b"\n\\c'
    np.testing.assert_allclose(
        back.registration.T_measured_robroot, registration.T_measured_robroot, atol=1e-12
    )
    np.testing.assert_allclose(back.registration.p_flange_point, [0.1, 0, 0.362], atol=1e-15)
    assert back.registration.rms == pytest.approx(2e-5)


def test_nan_survives_as_what_the_data_could_not_tell(tmp_path):
    text = save_model(
        ModelFile({"joint_offset": {"offset_deg": [math.nan, 1.0, 0.0, 0.0, 0.0, 0.0]}})
    )
    model = load(tmp_path, text.decode())
    values = model.values("joint_offset", "offset_deg", (6,))
    assert math.isnan(values[0])
    assert values[1] == pytest.approx(math.radians(1.0))


@pytest.mark.parametrize(
    ("text", "code", "line", "words"),
    [
        ("schema = ", "MOD001", 1, "TOML"),
        ("", "MOD002", 1, "postproc.model/1"),
        ('schema = "postproc.model/9"', "MOD002", 1, "postproc.model/9"),
        (CONTRACT + "[efects]\na = 1\n", "MOD003", 6, "'effects'"),
        (CONTRACT.replace("joint_offset", "joint_ofset"), "MOD003", 4, "'joint_offset'"),
        (CONTRACT + "[registration]\nrobrot_xyz_mm = [1,2,3]\n", "MOD003", 7, "robroot_xyz_mm"),
        (CONTRACT + "[registration]\nrobroot_xyz_mm = [1,2,3]\n", "MOD005", 6, "robroot_abc_deg"),
        ('schema = "postproc.model/1"\neffects = 3', "MOD006", 2, "tables"),
        ('schema = "postproc.model/1"\nnotes = [1]', "MOD006", 2, "texts"),
        ('schema = "postproc.model/1"\n[effects]\njoint_offset = 3', "MOD006", 3, "table"),
    ],
)
def test_complaints_carry_code_line_and_help(tmp_path, text, code, line, words):
    with pytest.raises(DataError) as caught:
        load(tmp_path, text)
    assert caught.value.code == code
    assert caught.value.source.line == line
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("value", "code"),
    [("[1, 2]", "MOD006"), ('"much"', "MOD006"), ("[[1,2],[3]]", "MOD006"), ("true", "MOD006")],
)
def test_values_of_another_shape_are_refused(tmp_path, value, code):
    model = load(
        tmp_path, f'schema = "postproc.model/1"\n[effects.joint_offset]\noffset_deg = {value}\n'
    )
    with pytest.raises(DataError, match=rf"model\.toml:3: error {code}"):
        model.values("joint_offset", "offset_deg", (6,))


def test_effects_check_their_own_keys(tmp_path):
    model = load(tmp_path, CONTRACT.replace("offset_deg", "ofset_deg"))
    with pytest.raises(DataError, match=r"model\.toml:5: error MOD004.*'offset_deg'"):
        model.require_known("joint_offset", ["offset_deg"])
    with pytest.raises(DataError, match="MOD005"):
        model.values("joint_offset", "offset_deg", (6,))
    assert model.values("joint_offset", "offset_deg", (6,), optional=True) is None


def test_effects_of_foreign_names_are_kept(tmp_path):
    model = load(tmp_path, CONTRACT + "[effects.belt_slack]\nslack_mm = 0.2\n")
    assert model.values("belt_slack", "slack_mm") == pytest.approx(2e-4)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(ReadError, match="IO001"):
        load_model(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("key", "size"),
    [
        ("x_mm", 1e-3),
        ("offset_deg", math.pi / 180),
        ("stiffness_Nmm_per_rad", 1e-3),
        ("rate_deg_per_K", math.pi / 180),
        ("growth_mm_per_K", 1e-3),
        ("mass_kg", 1.0),
        ("moment_Nm", 1.0),
        ("terms", 1.0),
        ("mm", 1.0),
    ],
)
def test_units_stand_at_the_end_of_a_key(key, size):
    assert factor(key) == pytest.approx(size)
    assert si(key, [2.0]).tolist() == pytest.approx([2.0 * size])
    assert entry(key, [[2.0 * size]]) == [[pytest.approx(2.0)]]


VALUES = st.recursive(
    st.one_of(
        st.integers(-(2**60), 2**60),
        st.floats(allow_nan=False),
        st.booleans(),
        st.text(max_size=20),
    ),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=12,
)


@settings(deadline=None, max_examples=150)
@given(st.text(max_size=12), VALUES)
def test_any_value_comes_back_from_toml(key, value):
    text = f"{toml_key(key)} = {toml_value(value)}\n"
    assert tomllib.loads(text)[key] == value


def test_what_toml_has_no_form_for_is_refused():
    with pytest.raises(DataError, match="MOD007"):
        save_model(ModelFile({"joint_offset": {"offset_deg": None}}))
