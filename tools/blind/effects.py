"""The hidden effects: how their numbers are drawn and what they do to the real robot.

Each pair ``draw``/``change`` is one effect. Forms differ on purpose from a textbook's: soft gear
flanks, two time constants, harmonics beside the tooth order, saturating lag, gas springs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tools.blind.campaign import Rows
from tools.blind.chain import JOINTS, SCREWS, Array, G, Poses, torques
from tools.blind.robots import RobotClass
from tools.blind.world import TOOL_BODY, State

Draw = Callable[[np.random.Generator, RobotClass, Rows], dict[str, Array]]
Change = Callable[[State, dict[str, Array], float], None]
SIDES = np.array([-1.0, 1.0])
STRONGEST = 5.0
"""Strength of an effect that nothing but its size on the tool bounds."""
PRELOAD = 0.45
"""Stretch of the counterbalance spring with the crank across [m]: mostly once per turn of A2."""


@dataclass(frozen=True)
class Kind:
    """A kind of effect.

    Args:
        needs: columns without which nobody can see it; loads, frames: it needs loads / a campaign
            whose frame is known; builtin_only: not on the small arm; strength: (low, high).
        own_names: names under which a library may hold it; classes: what its gap is a function of.
    """

    draw: Draw
    change: Change
    strength: tuple[float, float] = (0.15, STRONGEST)
    needs: tuple[str, ...] = ()
    loads: bool = False
    frames: bool = False
    builtin_only: bool = False
    registered: bool = False
    own_names: tuple[str, ...] = ()
    classes: tuple[str, ...] = ()


def some(rng: np.random.Generator, low: int, high: int, among: int = 6) -> Array:
    """Return a mask (6,) of a few joints, the first ``among`` being eligible."""
    mask = np.zeros(6)
    mask[rng.choice(among, rng.integers(low, high + 1), replace=False)] = 1.0
    return mask


def small_turn(v: Array, x: Array) -> Array:
    """Return the motion (n, 3) of points (n, 3) by a small rotation vector (3,)."""
    return np.cross(np.broadcast_to(v, x.shape), x)


# Frames and geometry


def _draw_frame(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"shift": rng.normal(0, 2.5e-4, 3), "turn": rng.normal(0, 1.2e-4, 3)}


def _base_frame(state: State, x: dict[str, Array], s: float) -> None:
    state.after.append(lambda p: s * (x["shift"] + small_turn(x["turn"], p)))


def _draw_tool(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"shift": rng.normal(0, 3e-4, 3)}


def _tool_frame(state: State, x: dict[str, Array], s: float) -> None:
    state.tool = state.tool + s * x["shift"]


def place_reflector(state: State, x: dict[str, Array], s: float) -> None:
    """Measure a point beside the tool point; the loads stay there."""
    state.reflector = state.reflector + s * x["shift"]


def _draw_offset(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"offset": rng.normal(0, 1.5e-4, 6) * some(rng, 2, 6)}


def _joint_offset(state: State, x: dict[str, Array], s: float) -> None:
    state.theta[:, JOINTS] += s * x["offset"]


def _draw_geometry(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"point": rng.normal(0, 2e-4, (7, 3)), "tilt": rng.normal(0, 1.2e-4, (6, 3))}


def _link_geometry(state: State, x: dict[str, Array], s: float) -> None:
    shift = s * np.cumsum(x["point"], axis=0)
    for k, at in enumerate(JOINTS):
        state.geometry.point[:, at] += shift[k]
        axis = state.geometry.axis[:, at] + small_turn(s * x["tilt"][k], state.geometry.axis[:, at])
        state.geometry.axis[:, at] = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    state.geometry.flange_p += shift[6]


# Springs


def _draw_give(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"factor": np.exp(rng.normal(0, 0.25, 6)), "hardening": rng.uniform(0.0, 0.08, 1)}


def _joint_compliance(state: State, x: dict[str, Array], s: float) -> None:
    state.give[:, JOINTS] *= s * x["factor"]
    state.hardening = max(state.hardening, float(x["hardening"][0]))
    state.load_gives = 1.0


def _draw_weight(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "share": rng.uniform(0.15, 0.5, 1),
        "mass": rng.uniform(0.8, 1.25, 6),
        "com": rng.normal(0, 0.03, (6, 3)),
    }


def _gravity_sag(state: State, x: dict[str, Array], s: float) -> None:
    state.weight = s * float(x["share"][0])
    state.mass = state.mass * x["mass"]
    state.com = state.com + x["com"]


def _draw_varying(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "amplitude": rng.uniform(0.25, 0.55, 6) * rng.choice(SIDES, 6),
        "phase": rng.uniform(0, 2 * np.pi, 6),
        "order": rng.choice([1.0, 1.0, 2.0], 6),
    }


def _variable_stiffness(state: State, x: dict[str, Array], s: float) -> None:
    wave = np.sin(x["order"] * state.rows.q + x["phase"])
    state.give[:, JOINTS] *= np.maximum(1.0 + min(s, 1.2) * x["amplitude"] * wave, 0.1)


# Drives and gears


def _draw_gap(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"half": rng.uniform(0.4e-4, 2.5e-4, 6) * some(rng, 2, 5), "soft": np.array([2.2])}


def _backlash(state: State, x: dict[str, Array], s: float) -> None:
    side = np.tanh(x["soft"][0] * state.rows.direction) / np.tanh(x["soft"][0])
    pressed = 0.03 * np.sin(state.rows.q + 0.4)
    state.theta[:, JOINTS] -= s * x["half"] * (side + pressed)


def _draw_ripple(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "size": rng.uniform(0.8e-4, 2.2e-4, 6) * some(rng, 1, 3, 4),
        "order": rng.choice([2.0, 3.0, 4.0, 8.0, 12.0, 17.0, 20.0, 29.0], 6),
        "phase": rng.uniform(0, 2 * np.pi, (2, 6)),
    }


def _transmission_error(state: State, x: dict[str, Array], s: float) -> None:
    angle = x["order"] * state.rows.q
    wave = np.sin(angle + x["phase"][0]) + 0.12 * np.sin(2 * angle + x["phase"][1])
    state.theta[:, JOINTS] += s * x["size"] * wave


def _draw_lag(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"lag": rng.uniform(2e-4, 8e-4, 6), "bend": rng.uniform(0.0, 0.1, 6)}


def _servo_lag(state: State, x: dict[str, Array], s: float) -> None:
    qd = state.rows.qd
    state.theta[:, JOINTS] -= s * x["lag"] * qd / (1.0 + x["bend"] * np.abs(qd))


def _draw_coupling(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"ratio": rng.uniform(0.8e-4, 3e-4, 3) * rng.choice(SIDES, 3)}


def _gear_coupling(state: State, x: dict[str, Array], s: float) -> None:
    q4, q5 = state.rows.q[:, 3], state.rows.q[:, 4]
    c54, c64, c65 = s * x["ratio"]
    state.theta[:, JOINTS[4]] += c54 * (q4 + 0.03 * np.sin(2 * q4))
    state.theta[:, JOINTS[5]] += c64 * q4 + c65 * q5


# Warmth


def _draw_warmth(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "growth": rng.uniform(0.9e-5, 2.0e-5, 7),
        "drive": rng.normal(0, 1.2e-5, 6) * np.array([0.3, 1, 1, 0.3, 0.5, 0.0]),
        "slow": rng.uniform(300, 1500, 1),
        "weight": rng.uniform(0.1, 0.3, 1),
    }


def _thermal_drift(state: State, x: dict[str, Array], s: float) -> None:
    rows = state.rows
    warm = rows.temp - rows.start_temp
    late = np.empty_like(warm)
    late[0] = warm[0]
    for k in range(1, len(warm)):
        share = 1.0 - np.exp(-(rows.time[k] - rows.time[k - 1]) / x["slow"][0])
        late[k] = late[k - 1] + share * (warm[k] - late[k - 1])
    mixed = (1 - x["weight"][0]) * warm + x["weight"][0] * late
    grown, geometry = np.zeros((len(warm), 3)), state.geometry
    before = np.zeros((len(warm), 3))
    for k, at in enumerate(JOINTS):
        step = geometry.point[:, at] - before
        before = geometry.point[:, at].copy()
        grown = grown + (s * x["growth"][k] * mixed)[:, None] * step
        geometry.point[:, at] += grown
    step = geometry.flange_p - before
    geometry.flange_p = geometry.flange_p + grown + (s * x["growth"][6] * mixed)[:, None] * step
    state.theta[:, JOINTS] += s * mixed[:, None] * x["drive"]


# Weights and springs outside the drives


def _draw_payload(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "mass": np.array(
            [rng.uniform(0.4, 1.0) * robot.force / 25.0 * rng.choice(SIDES, p=[0.3, 0.7])]
        ),
        "com": rng.normal(0, 0.02, 3),
    }


def _payload_error(state: State, x: dict[str, Array], s: float) -> None:
    robot = state.robot
    told, real = robot.tool_com, robot.tool_com + s * x["com"]
    mass = robot.tool_mass + s * float(x["mass"][0])

    def pull(poses: Poses) -> Array:
        n = len(state.rows.q)
        more = torques(poses, TOOL_BODY, poses.tool_point(real), np.tile(mass * G, (n, 1)))
        known = np.tile(robot.tool_mass * G, (n, 1))
        return more - torques(poses, TOOL_BODY, poses.tool_point(told), known)

    state.pulls.append(pull)


def _draw_spring(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    reach = 0.75 * robot.arm.point[1, 2]
    return {
        "anchor": rng.uniform(0.8, 1.1) * reach * np.array([-1.0, -0.6]),
        "crank": np.array([rng.uniform(0.1, 0.16), rng.uniform(-0.4, 0.4)]),
        "rate": np.array([rng.choice(SIDES) * rng.uniform(0.3e5, 0.8e5)]),
    }


def _counterbalance(state: State, x: dict[str, Array], s: float) -> None:
    q2 = state.rows.q[:, 1]
    angle = x["crank"][1] + q2
    crank = x["crank"][0] * np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    rod = crank - x["anchor"]
    length = np.linalg.norm(rod, axis=1)
    rest = np.linalg.norm(x["anchor"]) - PRELOAD
    force = s * x["rate"][0] * (length - rest) * (1.0 + 0.3 * (length - rest))
    swing = x["crank"][0] * np.stack([-np.sin(angle), -np.cos(angle)], axis=1)
    torque = np.zeros((len(q2), len(SCREWS)))
    torque[:, JOINTS[1]] = -force * np.sum(rod * swing, axis=1) / length
    state.pulls.append(lambda _: torque)


LIBRARY: dict[str, Kind] = {
    "base_frame": Kind(_draw_frame, _base_frame, frames=True),
    "tool_frame": Kind(_draw_tool, _tool_frame, frames=True),
    "joint_offset": Kind(_draw_offset, _joint_offset),
    "link_geometry": Kind(_draw_geometry, _link_geometry),
    "joint_compliance": Kind(_draw_give, _joint_compliance, (0.4, 2.5), loads=True),
    "gravity_sag": Kind(_draw_weight, _gravity_sag, (0.1, 2.5)),
    "variable_stiffness": Kind(_draw_varying, _variable_stiffness, (0.7, 1.2), loads=True),
    "backlash": Kind(_draw_gap, _backlash, needs=("dir",)),
    "transmission_error": Kind(_draw_ripple, _transmission_error),
    "thermal_drift": Kind(_draw_warmth, _thermal_drift, (0.4, 3.0), needs=("temp_C", "time_s")),
    "servo_lag": Kind(_draw_lag, _servo_lag, needs=("qd",)),
    "gear_coupling": Kind(_draw_coupling, _gear_coupling),
    "payload_error": Kind(_draw_payload, _payload_error, (0.2, 3.0)),
    "counterbalance": Kind(_draw_spring, _counterbalance, builtin_only=True),
}
