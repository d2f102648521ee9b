"""What keeps a name from being called too surely, and a drift from being called noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, nnls

from postproc.gap.answers.diagnose import diagnose
from postproc.gap.choice import (
    Choice,
    Standing,
    doubted,
    elusive,
    groups_of,
    is_overshadowed,
    is_undecided,
    uneven,
)
from postproc.gap.choice.choice import choose
from postproc.gap.choice.classes import Part, wandering
from postproc.gap.choice.confounding import in_place_of_two, taken_in_by
from postproc.gap.choice.evidence import Evidence
from postproc.gap.choice.search import DECISIVE, TEMPERATURE, Search, search
from postproc.gap.choice.selection import wave_block
from postproc.gap.data.dataset import FADES
from postproc.gap.fit.linear import NormalEquations, block_of
from postproc.gap.fit.noise import Noise, Source
from postproc.gap.fit.problem import pose_problem
from postproc.gap.fit.regression import Regression
from postproc.gap.fit.waves import Projection
from postproc.gap.robot_model import effect_of
from postproc.measurement.file import read_measurements


def test_odds_of_two_sets_are_those_of_their_tempered_scores():
    lead = 3.0 * DECISIVE
    names = {"a": "sag", "b": "payload"}
    equations = NormalEquations([], np.zeros((0, 0)), np.zeros(0), 0.0)
    found = Search(equations, (), 10, names, {}, {("a",): 100.0, ("b",): 100.0 - lead})
    odds = np.exp(lead / TEMPERATURE)
    assert found.inclusion() == pytest.approx({"sag": odds / (1 + odds), "payload": 1 / (1 + odds)})


@pytest.mark.parametrize(("ratio", "told"), [(1.0, False), (2.0, True)])
def test_a_wander_far_above_the_white_noise_is_a_course_of_time(ratio, told):
    white = 2e-5
    noise = Noise(white, Source.REPEATS, white=white, wander=ratio * white)
    small = Part("time", "station", "ramp", 0.1 * white, 20.0)
    parts = wandering(noise, (small,))
    assert [p.shape for p in parts] == (["wander", "ramp"] if told else ["ramp"])
    if told:
        assert parts[0].rms == pytest.approx(np.sqrt(3.0) * noise.wander)
        assert wandering(noise, parts) == parts


def test_a_drift_is_no_noise_where_no_time_was_logged(world, kinematics, cell, tmp_path):
    data, measured, *_ = world.make(51, {"step": 3e-4}, n=160, noise=2e-5)
    path = tmp_path / "rows.csv"
    path.write_text(world.csv(data, measured, ("time", "temp")))
    diagnosis = diagnose(pose_problem(read_measurements(path), kinematics, cell))
    assert diagnosis.problem.samples.time is None
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.unexplained[0].kind == "time"
    assert "row" in diagnosis.unexplained[0].shape


def test_what_earlier_loads_leave_is_their_relaxed_sum(samples):
    torque, time = samples.load_torque(), np.asarray(samples.time)
    before = np.concatenate([time[:1], time[:-1]])
    for k, fade in enumerate(FADES):
        since, until = time[:, None] - before, time[:, None] - time
        share = np.where(until >= 0, np.exp(-until / fade) - np.exp(-since / fade), 0.0)
        told = samples.column("past").reshape(len(time), len(FADES), 6)[:, k]
        np.testing.assert_allclose(told, share @ torque, atol=1e-9 * np.abs(torque).max())


@pytest.mark.parametrize("fade", [350.0, 520.0, 700.0, 1600.0, 2500.0])
def test_the_fixed_delays_stand_for_any_between_them(samples, fade):
    """A relaxation of another delay, written out, by one number for each delay that is none."""
    torque, time = samples.load_torque(), np.asarray(samples.time)
    before = np.concatenate([time[:1], time[:-1]])
    since, until = time[:, None] - before, time[:, None] - time
    share = np.where(until >= 0, np.exp(-until / fade) - np.exp(-since / fade), 0.0)
    told = samples.column("past").reshape(len(time), len(FADES), 6)
    for joint in range(6):
        wanted = share @ torque[:, joint]
        assert nnls(told[:, :, joint], wanted)[1] < 0.04 * np.linalg.norm(wanted)


def test_a_spring_is_refused_only_where_its_second_wave_is_surely_large(samples):
    spring = effect_of("counterbalance")
    theta = np.array([0.0, 1.0, 0.9, 0.0]) * 1e-4
    assert spring.objection(theta, np.full(4, 1e-6), samples.arm)
    assert not spring.objection(theta, np.full(4, 3e-5), samples.arm)


def test_pairs_of_columns_are_weighed_as_one_by_one():
    rng = np.random.default_rng(2)
    context = Projection((), rng.normal(size=(40, 3)), np.ones(40))
    context.extend(rng.normal(size=(120, 7)))
    pairs = rng.normal(size=(120, 5, 2))
    each = [context.gain(pairs[:, k], context.rest) for k in range(5)]
    np.testing.assert_allclose(context.pair_gains(pairs, context.rest), each, rtol=1e-9)


@pytest.mark.parametrize(
    ("half_gap", "unusual"),
    [
        ([-9.0, -5.0, -4.0, 0.0, 1.0, 0.5], True),
        ([9.0, 5.0, 4.0, 0.0, -1.0, -0.5], False),
        ([9.0, 5.0, -4.0, 0.0, 0.0, 0.0], False),
    ],
)
def test_play_leaves_joints_behind(half_gap, unusual):
    unit = np.full(6, 2e-5)
    assert effect_of("backlash").is_unusual(np.array(half_gap) * unit, unit) == unusual


def test_no_effect_has_the_formula_of_an_approach_that_grows_with_load(samples):
    rival = {(g.kind, g.shape): g.is_rival for g in groups_of(samples, ())}
    assert rival["approach", "grows with load"]
    assert rival["speed", "quadratic"]
    assert not rival["approach", "constant"]
    assert not rival["speed", "proportional"]


@pytest.mark.parametrize(
    ("kind", "rms", "told"),
    [
        ("approach", 1.5e-5, False),
        ("approach", 2.5e-5, True),
        ("place", 9e-5, False),
        ("place", 1.1e-4, True),
    ],
)
def test_a_name_is_overshadowed_by_its_own_class_or_by_what_is_larger(kind, rms, told):
    sigma, key = 2e-5, "backlash"
    choice = Choice({key: Standing.ADOPTED}, {key: Evidence(99.0, 1e-4)}, {key: 1.0}, {})
    rest = (Part(kind, "joints", "grows with load", rms, 30.0),)
    assert is_overshadowed(choice, key, effect_of(key), rest, sigma) == told
    assert not is_overshadowed(choice, key, effect_of(key), (), sigma)


@pytest.mark.parametrize(("amplitude", "names"), [(2e-4, []), (0.0, ["transmission_error"])])
def test_waves_have_to_be_found_again_without_each_fold(world, samples_of_data, amplitude, names):
    rng, sigma = np.random.default_rng(4), 2e-5
    samples = samples_of_data(world.campaign(rng, 200, repeats=0))
    n = len(samples)
    wave = samples.jacobian[:, :, 1] * np.cos(17.0 * samples.q[:, 1] + 0.3)[:, None]
    y = amplitude * wave + rng.normal(0.0, sigma, (n, 3))
    block = wave_block(samples, ((2, 17.0),), "all")
    label = (np.argsort(np.argsort(samples.q[:, 0])) * 6 // n).astype(np.int32)
    regression = Regression(samples, y, np.full(n, 1.0 / sigma), label, (block,), ())
    choice = Choice({block.key: Standing.ADOPTED}, {block.key: Evidence(99.0, 1e-4)}, {}, {})
    assert list(elusive(regression, choice)) == names


@pytest.mark.parametrize(("spread", "told"), [(0.0, False), (0.05, False), (0.4, True)])
def test_a_name_of_uneven_strength_leaves_a_part_of_its_class(samples, spread, told):
    sigma, key = 2e-5, "backlash"
    rng = np.random.default_rng(8)
    block = block_of(effect_of(key), samples, {})
    strength = 1.0 + spread * rng.normal(size=len(samples))
    moved = (block.X @ (2.0 * np.ones(6))) * strength[:, None]
    y = moved + rng.normal(0.0, sigma, moved.shape)
    weight, fold = np.full(len(y), 1.0 / sigma), np.zeros(len(y), dtype=np.int32)
    regression = Regression(samples, y, weight, fold, (block,), ())
    choice = Choice({key: Standing.ADOPTED}, {key: Evidence(99.0, 3e-4)}, {key: 1.0}, {})
    parts = uneven(regression, choice)
    assert bool(parts) == told
    if told:
        size = np.sqrt(np.mean(np.sum(moved**2, axis=1)))
        assert (parts[0].kind, parts[0].of) == ("approach", key)
        assert parts[0].rms == pytest.approx(spread * size, rel=0.25)
        assert is_overshadowed(choice, key, effect_of(key), parts, sigma)


@pytest.mark.parametrize(
    ("order", "unique", "confounded", "told"),
    [
        (2.0, 2e-4, (), True),
        (2.0, 5e-5, (), False),
        (29.0, 2e-4, (), False),
        (29.0, 5e-5, ("joint_offset",), True),
    ],
)
def test_what_others_stand_for_as_well_is_undecided(samples, order, unique, confounded, told):
    waves = wave_block(samples, ((1, order),), "all")
    scale = block_of(effect_of("encoder_scale"), samples, {})
    y, fold = np.zeros((len(samples), 3)), np.zeros(len(samples), dtype=np.int32)
    regression = Regression(samples, y, np.ones(len(y)), fold, (waves, scale), ())
    evidence = {
        waves.key: Evidence(99.0, 1e-4, confounded=confounded),
        scale.key: Evidence(99.0, unique),
    }
    choice = Choice(dict.fromkeys(evidence, Standing.ADOPTED), evidence, {}, {})
    assert is_undecided(regression, choice, waves.key) == told
    assert not is_undecided(regression, choice, scale.key)


@pytest.mark.parametrize(("beside", "told"), [("transmission_error", True), ("backlash", False)])
def test_a_table_of_angles_beside_waves_may_hold_more_of_them(samples, beside, told):
    table = block_of(effect_of("angle_error"), samples, effect_of("angle_error").prepare(samples))
    waves = wave_block(samples, ((1, 29.0),), "all")
    other = waves if beside == "transmission_error" else block_of(effect_of(beside), samples, {})
    y, fold = np.zeros((len(samples), 3)), np.zeros(len(samples), dtype=np.int32)
    regression = Regression(samples, y, np.ones(len(y)), fold, (table, other), ())
    evidence = dict.fromkeys((table.key, other.key), Evidence(99.0, 1e-4))
    choice = Choice(dict.fromkeys(evidence, Standing.ADOPTED), evidence, {}, {})
    assert is_undecided(regression, choice, table.key) == told
    assert not is_undecided(regression, choice, other.key)


@pytest.mark.parametrize(("hidden", "told"), [("counterbalance", True), ("both", False)])
def test_one_cause_may_be_what_two_names_are_made_of(samples, hidden, told):
    """A spring at A2 looks like offsets and waves of A2; real offsets and waves like no spring."""
    offset, spring = (
        block_of(effect_of(n), samples, {}) for n in ("joint_offset", "counterbalance")
    )
    waves = wave_block(samples, ((2, 2.0),), "all")
    y = {
        "counterbalance": 3.0 * spring.X.sum(axis=2) + 0.1 * waves.X.sum(axis=2),
        "both": 3.0 * offset.X.sum(axis=2) + 3.0 * waves.X.sum(axis=2),
    }[hidden]
    sigma = 1e-5
    weight, fold = np.full(len(y), 1.0 / sigma), np.zeros(len(y), dtype=np.int32)
    regression = Regression(samples, y, weight, fold, (offset, spring, waves), ())
    found = search(regression.normal_equations(), exhaustive=0)
    named = (offset.key, waves.key)
    same = in_place_of_two(regression, found, named, named, ())
    assert same == ({key: {"counterbalance"} for key in named} if told else {})
    assert in_place_of_two(regression, found, named, named, (spring.key,)) == {}


@pytest.mark.parametrize(("unique", "told"), [(0.7, True), (2.0, False)])
def test_what_is_taken_in_almost_wholly_is_of_either(samples, unique, told):
    names = ("link_geometry", "gravity_sag")
    blocks = tuple(block_of(effect_of(n), samples, effect_of(n).prepare(samples)) for n in names)
    sigma = 1e-4
    y, fold = np.zeros((len(samples), 3)), np.zeros(len(samples), dtype=np.int32)
    regression = Regression(samples, y, np.full(len(y), 1.0 / sigma), fold, blocks, ())
    evidence = {"link_geometry": Evidence(99.0, unique * sigma), "gravity_sag": Evidence(9.0, 0.0)}
    found = taken_in_by(regression, names, evidence, "link_geometry")
    assert found == (("gravity_sag",) if told else ())


@pytest.mark.parametrize(
    ("lead", "named"), [(TEMPERATURE - 2.0, ()), (TEMPERATURE + 2.0, ("backlash",))]
)
def test_what_leads_nothing_by_little_is_no_cause(samples, lead, named):
    block = block_of(effect_of("backlash"), samples, {})
    moved, sigma = block.X.sum(axis=2), 1e-5
    weight, fold = np.full(len(moved), 1.0 / sigma), np.arange(len(moved), dtype=np.int32) % 4

    def of_size(size):
        return Regression(samples, size * moved, weight, fold, (block,), ())

    def ahead(size):
        found = search(of_size(size).normal_equations())
        return found.score(("backlash",)) - found.score(()) - lead

    choice = choose(of_size(brentq(ahead, 1e-6, 10.0)))
    assert choice.adopted == named, choice.reasons


@pytest.mark.parametrize(("shape", "told"), [(0.0, False), (0.02, False), (0.5, True)])
def test_a_class_is_ahead_beyond_what_an_inexact_formula_excuses(samples, shape, told):
    """Play that grows with the load on the joint is not the play of the formula."""
    block = block_of(effect_of("backlash"), samples, {})
    q, J = samples.q, samples.jacobian
    heavy = 1.0 + np.cos(q[:, 1:2]) + np.cos(q[:, 1:2] + q[:, 2:3])
    grown = np.einsum("nij,nj->ni", J, samples.direction * (1.0 + shape * heavy)) * 2e-4
    sigma = 1e-6
    weight, fold = np.full(len(q), 1.0 / sigma), np.zeros(len(q), dtype=np.int32)
    regression = Regression(samples, grown, weight, fold, (block,), ())
    evidence = {"backlash": Evidence(99.0, 3e-4)}
    choice = Choice({"backlash": Standing.ADOPTED}, evidence, {"backlash": 1.0}, {})
    judged = doubted(regression, choice)
    assert bool(judged.evidence["backlash"].rival) == told
    assert is_undecided(regression, judged, "backlash") == told
