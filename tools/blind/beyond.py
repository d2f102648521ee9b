"""Hidden effects beyond the names of the contract, and the names a library may hold them by."""

from __future__ import annotations

import numpy as np

from tools.blind.campaign import Rows
from tools.blind.chain import JOINTS, SCREWS, Array, G, Poses, torques
from tools.blind.effects import LIBRARY, Kind, small_turn, some
from tools.blind.robots import RobotClass
from tools.blind.world import TOOL_BODY, Hidden, State


def _draw_windup(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "dry": rng.uniform(0.2e-4, 0.7e-4, 6) * some(rng, 3, 6),
        "loaded": rng.uniform(0.8, 2.0, 6),
        "fades": rng.uniform(0.4, 0.8, 1),
        "after": rng.uniform(2.0, 6.0, 1),
    }


def _windup(state: State, x: dict[str, Array], s: float) -> None:
    """Friction winds the drives up; it fades while standing, and grows with the torque."""
    rows = state.rows
    bent = np.cos(rows.q[:, 1:2]) + 0.4 * np.cos(rows.q[:, 1:2] + rows.q[:, 2:3])
    fade = 1.0 - x["fades"][0] * (1.0 - np.exp(-rows.dwell / x["after"][0]))
    wound = x["dry"] * (1.0 + x["loaded"] * np.abs(bent)) * fade[:, None]
    state.theta[:, JOINTS] -= s * rows.direction * wound


def _draw_hard(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"rate": rng.uniform(2.0, 5.0, 1), "soft": rng.uniform(1.5, 2.5, 1)}


def _hardening(state: State, x: dict[str, Array], s: float) -> None:
    state.give[:, JOINTS] *= s * x["soft"][0]
    state.hardening = float(x["rate"][0]) * s * 2.0
    state.load_gives = 1.0


def _draw_bend(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"give": rng.uniform(0.3, 1.5, (2, 3)) * robot.arm.give[1]}


def _link_bending(state: State, x: dict[str, Array], s: float) -> None:
    for row, link in enumerate((2, 3)):
        for column, name in enumerate("xyz"):
            state.give[:, SCREWS.index(f"bend{link}_{name}")] = s * x["give"][row, column]


def _draw_creep(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "shift": rng.normal(0, 2e-4, 3),
        "turn": rng.normal(0, 5e-5, 3),
        "share": rng.uniform(0.3, 0.9, 1),
    }


def _tracker_creep(state: State, x: dict[str, Array], s: float) -> None:
    part = state.rows.time / max(state.rows.time[-1], 1.0)
    size = s * (1.0 - np.exp(-part / x["share"][0]))[:, None]
    state.after.append(lambda p: size * (x["shift"] + small_turn(x["turn"], p)))


def _draw_bump(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "shift": rng.normal(0, 2e-4, 3),
        "turn": rng.normal(0, 8e-5, 3),
        "when": rng.uniform(0.3, 0.7, 1),
    }


def _station_bump(state: State, x: dict[str, Array], s: float) -> None:
    late = (state.rows.time > x["when"][0] * state.rows.time[-1]).astype(float)
    state.after.append(lambda p: s * late[:, None] * (x["shift"] + small_turn(x["turn"], p)))


def _draw_lean(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"give": rng.uniform(0.6, 1.4, 2) * robot.arm.give[0] * 0.15}


def _leaning_column(state: State, x: dict[str, Array], s: float) -> None:
    """Lean the floor plate under the arm's overturning moment, weight included."""
    lean = [SCREWS.index("lean_x"), SCREWS.index("lean_y")]
    rows, robot = state.rows, state.robot
    give = s * x["give"]

    def pull(poses: Poses) -> Array:
        moment = np.zeros((len(rows.q), len(SCREWS)))
        own = 1.0 - state.weight
        for k in range(6):
            at = poses.body_point(int(JOINTS[k]), robot.arm.com[k])
            down = np.tile(own * robot.arm.mass[k] * G, (len(rows.q), 1))
            moment += torques(poses, int(JOINTS[k]), at, down)
        if not state.load_gives:
            moment += torques(poses, TOOL_BODY, poses.tool_point(state.tool), rows.force)
        moment[:, [k for k in range(len(SCREWS)) if k not in lean]] = 0.0
        return moment

    state.give[:, lean] = give
    state.pulls.append(pull)


def _draw_fixture(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    A = rng.normal(size=(3, 3))
    return {
        "give": (A @ A.T + 0.3 * np.eye(3)) * 1.5e-4 / robot.force,
        "slope": rng.normal(0, 1.0, 3) / max(4 * robot.extent, 0.3),
        "centre": robot.arm.point[4] * 0.6,
    }


def _fixture_give(state: State, x: dict[str, Array], s: float) -> None:
    """Yield of the fixture that carries the part: it depends on where, not on the joints."""

    def yielding(p: Array) -> Array:
        factor = 1.0 + np.tanh((p - x["centre"]) @ x["slope"])
        return s * factor[:, None] * (state.rows.force @ x["give"])

    state.after.append(yielding)


def _draw_scale(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    way = rng.normal(size=3)
    return {"way": way / np.linalg.norm(way), "scale": rng.uniform(1e-4, 3e-4, 1)}


def _sensor_scale(state: State, x: dict[str, Array], s: float) -> None:
    """Scale error of one axis of the measuring machine, bent a little."""
    span = 0.5 * np.linalg.norm(state.robot.arm.point[4])
    centre = 0.5 * state.robot.arm.point[4]

    def stretched(p: Array) -> Array:
        along = (p - centre) @ x["way"]
        return s * x["scale"][0] * (along + 0.3 * along**2 / span)[:, None] * x["way"]

    state.after.append(stretched)


def _draw_hose(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    height = robot.arm.point[1, 2]
    return {
        "anchor": height * np.array([rng.uniform(-0.6, 0.2), rng.uniform(-1, 1), 2.2]),
        "rate": np.array([robot.force * rng.uniform(0.15, 0.4)]),
        "rest": np.array([height * rng.uniform(0.9, 1.4)]),
    }


def _hose_pull(state: State, x: dict[str, Array], s: float) -> None:
    """Pull of a hose from the ceiling on the flange; slack below its length."""

    def pull(poses: Poses) -> Array:
        way = x["anchor"] - poses.flange_p
        length = np.linalg.norm(way, axis=1, keepdims=True)
        tension = s * x["rate"][0] * np.maximum(length - x["rest"][0], 0.0)
        return torques(poses, TOOL_BODY, poses.flange_p, tension * way / length)

    state.pulls.append(pull)


OUTSIDE: dict[str, Kind] = {
    "windup": Kind(_draw_windup, _windup, needs=("dir",), own_names=("friction_windup",)),
    "hardening": Kind(
        _draw_hard,
        _hardening,
        (0.4, 2.5),
        loads=True,
        own_names=("nonlinear_stiffness", "hardening"),
    ),
    "link_bending": Kind(
        _draw_bend,
        _link_bending,
        (0.2, 5.0),
        loads=True,
        own_names=("link_bending", "link_torsion", "tool_bending"),
    ),
    "tracker_creep": Kind(
        _draw_creep,
        _tracker_creep,
        needs=("time_s",),
        own_names=("tracker_creep", "tracker_drift", "fixture_drift"),
    ),
    "station_bump": Kind(
        _draw_bump,
        _station_bump,
        needs=("time_s",),
        registered=True,
        own_names=("tracker_creep", "tracker_drift", "station_shift"),
    ),
    "leaning_column": Kind(
        _draw_lean, _leaning_column, own_names=("leaning_base", "base_compliance", "leaning_column")
    ),
    "fixture_give": Kind(
        _draw_fixture,
        _fixture_give,
        loads=True,
        own_names=("fixture_compliance", "workpiece_compliance"),
    ),
    "sensor_scale": Kind(
        _draw_scale, _sensor_scale, own_names=("measurement_scale", "sensor_scale", "scale")
    ),
    "hose_pull": Kind(_draw_hose, _hose_pull, own_names=("hose", "cable_force", "hose_pull")),
}


def kind_of(name: str) -> Kind:
    """Return the kind of an effect of either table."""
    return LIBRARY[name] if name in LIBRARY else OUTSIDE[name]


def make(name: str, rng: np.random.Generator, robot: RobotClass, rows: Rows) -> Hidden:
    """Return an effect with drawn numbers at strength 1."""
    kind = kind_of(name)
    return Hidden(name, kind.draw(rng, robot, rows), 1.0, kind.change)
