"""Torques of joints: against energies of our own kinematics, closed forms and the way back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from postproc.cell import Tool, read_urdf_robot
from postproc.geometry import rotation_about, transform
from postproc.kinematics import build, dynamics_of
from tests.kinematics.urdf_text import (
    CENTRES,
    INERTIAS,
    MASSES,
    heavy_urdf,
    inertial,
    joint,
)

G = 9.80665
TOOL = Tool(
    number=1,
    name="head",
    T_flange_tcp=np.eye(4),
    known_axis=np.array([0.0, 0.0, 1.0]),
    mass=40.0,
    com=np.array([0.03, -0.02, 0.2]),
    inertia=np.array([0.9, 0.7, 0.4]),
)
BARE = replace(TOOL, mass=float("nan"), com=None, inertia=None)
STEP = 1e-5


def robot_of(folder, text, T_world_robroot=None):
    path = folder / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    robot = read_urdf_robot(path)
    return robot if T_world_robroot is None else replace(robot, T_world_robroot=T_world_robroot)


def tensor(values):
    xx, yy, zz, xy, xz, yz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def bodies(robot, tool):
    """Frame number, mass, centre and inertia about it of every body; 7 is the flange."""
    own = zip(MASSES, CENTRES, INERTIAS, strict=True)
    found = [
        (i, mass, np.array([float(v) for v in centre.split()]), tensor(values))
        for i, (mass, centre, values) in enumerate(own, start=1)
    ]
    if tool.com is not None:
        found.append((7, tool.mass, np.asarray(tool.com), np.diag(tool.inertia)))
    return found


def places(robot, q):
    kinematics = build(robot)
    return np.concatenate([kinematics.link_frames(q), kinematics.fk(q)[..., None, :, :]], axis=-3)


def potential(robot, tool, q):
    """Energy (n,) [J] of the weights at joints (n, 6)."""
    T = places(robot, q)
    total = np.zeros(len(q))
    for frame, mass, centre, _ in bodies(robot, tool):
        point = T[:, frame, :3, :3] @ centre + T[:, frame, :3, 3]
        total -= mass * point @ robot.gravity
    return total


def kinetic(robot, tool, q, qd):
    """Energy (n,) [J] of the motion, by differences of where the bodies are."""
    after, before = (places(robot, q + sign * STEP * qd) for sign in (1.0, -1.0))
    here = places(robot, q)
    total = np.zeros(len(q))
    for frame, mass, centre, inertia in bodies(robot, tool):
        ends = [T[:, frame, :3, :3] @ centre + T[:, frame, :3, 3] for T in (after, before)]
        v = (ends[0] - ends[1]) / (2.0 * STEP)
        turning = (after - before)[:, frame, :3, :3] / (2.0 * STEP)
        spin = np.swapaxes(here[:, frame, :3, :3], 1, 2) @ turning  # [w]x in axes of the body
        w = np.column_stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]])
        total += 0.5 * mass * (v**2).sum(axis=1)
        total += 0.5 * np.einsum("ni,ij,nj->n", w, inertia, w)
    return total


@pytest.fixture(params=["bare", "tool", "tilted"])
def arm(request, tmp_path):
    tool = BARE if request.param == "bare" else TOOL
    tilt = transform(rotation_about(np.array([0.6, 0.0, 0.8]), 0.7), np.array([1.0, 2.0, 3.0]))
    root = tilt if request.param == "tilted" else None
    robot = robot_of(tmp_path, heavy_urdf(), root)
    return robot, tool, dynamics_of(robot, tool)


def test_to_stand_still_is_the_slope_of_the_weights_energy(arm):
    robot, tool, dynamics = arm
    q = np.random.default_rng(1).uniform(-2.5, 2.5, (20, 6))
    still = dynamics.torques(q, 0.0 * q, 0.0 * q)
    for axis, step in enumerate(1e-4 * np.eye(6)):
        slope = (potential(robot, tool, q + step) - potential(robot, tool, q - step)) / 2e-4
        np.testing.assert_allclose(still[:, axis], slope, atol=1e-4)


def test_to_speed_up_from_rest_is_the_mass_matrix_of_the_kinetic_energy(arm):
    robot, tool, dynamics = arm
    rng = np.random.default_rng(2)
    q, qdd = rng.uniform(-2.5, 2.5, (2, 10, 6))
    zero = np.zeros_like(q)
    got = dynamics.torques(q, zero, qdd) - dynamics.torques(q, zero, zero)
    single = [kinetic(robot, tool, q, np.broadcast_to(e, q.shape)) for e in np.eye(6)]
    for i, e in enumerate(np.eye(6)):
        want = np.zeros(len(q))
        for j, f in enumerate(np.eye(6)):
            both = kinetic(robot, tool, q, np.broadcast_to(e + f, q.shape))
            want += (both - single[i] - single[j]) * qdd[:, j]
        np.testing.assert_allclose(got[:, i], want, rtol=1e-4, atol=1e-2)


def test_power_of_the_joints_is_the_change_of_energy(arm):
    robot, tool, dynamics = arm
    rng = np.random.default_rng(3)
    a, b, phase = rng.uniform(-0.8, 0.8, (3, 6))

    def at(t):
        t = np.atleast_1d(t)[:, None]
        wave = 2.0 * t + phase
        return a * np.sin(wave) + b * t, 2.0 * a * np.cos(wave) + b, -4.0 * a * np.sin(wave)

    t, h = np.linspace(0.0, 2.0, 15), 1e-4
    energy = []
    for moment in (t - h, t + h):
        q, qd, _ = at(moment)
        energy.append(potential(robot, tool, q) + kinetic(robot, tool, q, qd))
    q, qd, qdd = at(t)
    power = (dynamics.torques(q, qd, qdd) * qd).sum(axis=1)
    np.testing.assert_allclose(power, (energy[1] - energy[0]) / (2.0 * h), rtol=1e-3, atol=0.5)


def test_a_pendulum(tmp_path):
    """All weight hangs on A5, whose axis is level: m g l cos, and (m l^2 + J) for its turn."""
    light = inertial(1e-9, "0 0 0", [1e-9] * 3 + [0.0] * 3)
    text = heavy_urdf()
    for values in zip(MASSES, CENTRES, INERTIAS, strict=True):
        text = text.replace(inertial(*values), light)
    mass, length, own = 12.0, 0.7, 0.4
    bob = inertial(mass, f"{length} 0 0", [own] * 3 + [0.0] * 3)
    text = text.replace(f'<link name="l5">{light}', f'<link name="l5">{bob}')
    dynamics = dynamics_of(robot_of(tmp_path, text), BARE)
    q, qd, qdd = np.zeros((3, 30, 6))
    q[:, 4] = angle = np.linspace(-2.5, 2.5, 30)
    qd[:, 4], qdd[:, 4] = 1.3, 2.1
    want = -mass * G * length * np.cos(angle) + (mass * length**2 + own) * 2.1
    np.testing.assert_allclose(dynamics.torques(q, qd, qdd)[:, 4], want, atol=1e-6)


def test_two_links_in_a_plane(tmp_path):
    """A2 and A3 of an arm without other masses: the textbook's equations, Coriolis terms too."""
    light = inertial(1e-9, "0 0 0", [1e-9] * 3 + [0.0] * 3)
    text = heavy_urdf()
    for values in zip(MASSES, CENTRES, INERTIAS, strict=True):
        text = text.replace(inertial(*values), light)
    m1, m2, l1, c1, c2, i1, i2 = 20.0, 10.0, 1.3, 0.5, 0.4, 1.5, 0.7
    for name, mass, centre, own in (("l2", m1, c1, i1), ("l3", m2, c2, i2)):
        body = inertial(mass, f"0 0 {centre}", [own] * 3 + [0.0] * 3)
        text = text.replace(f'<link name="{name}">{light}', f'<link name="{name}">{body}')
    dynamics = dynamics_of(robot_of(tmp_path, text), BARE)
    q, qd, qdd = np.zeros((3, 40, 6))
    rng = np.random.default_rng(4)
    q[:, 1:3], qd[:, 1:3], qdd[:, 1:3] = rng.uniform(-2.0, 2.0, (3, 40, 2))
    (a, b), (da, db), (dda, ddb) = q[:, 1:3].T, qd[:, 1:3].T, qdd[:, 1:3].T
    h = m2 * l1 * c2
    m12 = m2 * c2**2 + h * np.cos(b) + i2
    m11 = m1 * c1**2 + m2 * l1**2 + h * np.cos(b) + m12 + i1
    upright, lower = m1 * c1 + m2 * l1, m2 * c2 * np.sin(a + b)
    first = m11 * dda + m12 * ddb - h * np.sin(b) * (2.0 * da * db + db**2)
    second = m12 * dda + (m2 * c2**2 + i2) * ddb + h * np.sin(b) * da**2
    first -= G * (upright * np.sin(a) + lower)
    second -= G * lower
    got = dynamics.torques(q, qd, qdd)
    np.testing.assert_allclose(got[:, 1], first, atol=1e-6)
    np.testing.assert_allclose(got[:, 2], second, atol=1e-6)


def test_forward_dynamics_lead_back(arm):
    _, _, dynamics = arm
    q, qd, qdd = np.random.default_rng(5).uniform(-2.0, 2.0, (3, 20, 6))
    tau = dynamics.torques(q, qd, qdd)
    data = dynamics.model.createData()
    for row in zip(q, qd, tau, qdd, strict=True):
        back = pinocchio.aba(dynamics.model, data, *row[:3])
        np.testing.assert_allclose(back, row[3], atol=1e-9)


def test_a_tool_counts_as_a_body_welded_to_the_flange(tmp_path):
    tensor_ = [*TOOL.inertia, 0.0, 0.0, 0.0]
    body = inertial(TOOL.mass, " ".join(map(str, TOOL.com)), tensor_)
    last = f'<link name="head">{body}</link>' + joint(
        "weld", "fixed", "flange", "head", "0 0 0", "0 0 0"
    )
    welded = dynamics_of(robot_of(tmp_path, heavy_urdf(last=last)), BARE)
    mounted = dynamics_of(robot_of(tmp_path, heavy_urdf()), TOOL)
    motion = np.random.default_rng(6).uniform(-2.0, 2.0, (3, 20, 6))
    np.testing.assert_allclose(mounted.torques(*motion), welded.torques(*motion), atol=1e-9)


def test_joints_without_limits_and_fingers_behind_the_flange_stand_for_themselves(tmp_path):
    finger = f'<link name="finger">{inertial(1.0, "0 0 0", [0.1] * 3 + [0.0] * 3)}</link>'
    finger += joint("grip", "prismatic", "flange", "finger", "0 0 0.1", "0 0 0", limit="0 0.1 1")
    welded = finger.replace("prismatic", "fixed")
    motion = np.random.default_rng(7).uniform(-2.0, 2.0, (3, 20, 6))
    texts = [heavy_urdf(last=part) for part in (finger, welded)]
    texts.append(texts[1].replace('name="j4" type="revolute"', 'name="j4" type="continuous"'))
    got = []
    for text in texts:
        path = tmp_path / "arm.urdf"
        path.write_text(text, encoding="utf-8")
        got.append(dynamics_of(read_urdf_robot(path, "flange"), BARE).torques(*motion))
    np.testing.assert_allclose(got[0], got[1], atol=1e-9)
    np.testing.assert_allclose(got[2], got[1], atol=1e-9)


def test_nothing_is_claimed_of_an_arm_that_lacks_an_inertia(tmp_path):
    whole = robot_of(tmp_path, heavy_urdf())
    np.testing.assert_allclose(whole.torque_max, [4000, 4500, 3000, 800, 700, 400])
    for text in (
        heavy_urdf(without=5),
        heavy_urdf().replace('izz="0.2"', 'izz="0"'),
        heavy_urdf().replace('<mass value="8.0"/>', '<mass value="0"/>'),
    ):
        robot = robot_of(tmp_path, text)
        assert dynamics_of(robot, TOOL) is None
        assert robot.torque_max is None
    unbounded = robot_of(tmp_path, heavy_urdf((4000.0, 0.0, 1.0, 1.0, 1.0, 1.0)))
    assert unbounded.torque_max is None
    assert dynamics_of(unbounded, TOOL) is not None
