"""Hidden effects beyond the names of the contract, and the names a library may hold them by."""

from __future__ import annotations

import numpy as np

from tools.blind.around import AROUND, UNLISTED
from tools.blind.campaign import Rows
from tools.blind.chain import JOINTS, SCREWS, Array, G, Geometry, Poses, embed, sweep, torques
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


def _draw_encoder(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"scale": rng.normal(0, 2e-4, 6) * some(rng, 1, 2, 3), "bent": rng.normal(0, 0.05, 6)}


def _encoder_scale(state: State, x: dict[str, Array], s: float) -> None:
    """An encoder that counts wrongly: in proportion to the angle, a little bent."""
    q = state.rows.q
    state.theta[:, JOINTS] += s * x["scale"] * (q + x["bent"] * q**2)


def _draw_runout(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"shift": rng.normal(0, 1.2e-4, (2, 3)), "joint": np.array([float(rng.integers(0, 3))])}


def _bearing_runout(state: State, x: dict[str, Array], s: float) -> None:
    """A main bearing that runs out: what it carries is shifted once per turn, in a fixed frame."""
    q = state.rows.q[:, int(x["joint"][0])]
    wave = np.cos(q)[:, None] * x["shift"][0] + np.sin(q)[:, None] * x["shift"][1]
    state.after.append(lambda p: s * wave)


def _draw_slip(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"turn": 3e-4 * some(rng, 1, 1, 5), "when": rng.uniform(0.25, 0.75, 1)}


def _encoder_slip(state: State, x: dict[str, Array], s: float) -> None:
    """A brake or an encoder slips: one zero is another from then on."""
    late = state.rows.time > x["when"][0] * state.rows.time[-1]
    state.theta[:, JOINTS] += s * late[:, None] * x["turn"]


def _draw_late(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"give": robot.arm.give * rng.uniform(0.2, 1.0, 6), "fades": rng.uniform(500, 2000, 1)}


def _load_creep(state: State, x: dict[str, Array], s: float) -> None:
    """Gears that go on giving under a load for minutes, and come back as slowly."""
    rows = state.rows
    robot, n = state.robot, len(rows.q)
    poses = sweep(Geometry.of(robot.arm, n), embed(rows.q))
    pull = torques(poses, TOOL_BODY, poses.tool_point(state.tool), rows.force)[:, JOINTS]
    lag, now, before = np.zeros_like(pull), np.zeros(6), rows.time[0]
    for k in range(n):
        keep = np.exp(-(rows.time[k] - before) / x["fades"][0])
        now, before = keep * now + (1 - keep) * pull[k], rows.time[k]
        lag[k] = now
    state.theta[:, JOINTS] += s * x["give"] * lag


def _draw_wander(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    knots = np.linspace(0.0, 1.0, 40)
    K = np.exp(-np.abs(knots[:, None] - knots) / rng.uniform(0.05, 0.2))
    return {"shift": 1e-4 * np.linalg.cholesky(K + 1e-9 * np.eye(40)) @ rng.normal(size=(40, 3))}


def _tracker_wander(state: State, x: dict[str, Array], s: float) -> None:
    """A tracker that wanders with the air in the hall."""
    part = state.rows.time / max(state.rows.time[-1], 1.0) * (len(x["shift"]) - 1)
    knots = np.arange(len(x["shift"]))
    way = np.column_stack([np.interp(part, knots, x["shift"][:, k]) for k in range(3)])
    state.after.append(lambda p: s * way)


OUTSIDE: dict[str, Kind] = {
    "encoder_scale": Kind(
        _draw_encoder, _encoder_scale, own_names=("encoder_scale",), classes=("joint",)
    ),
    "bearing_runout": Kind(
        _draw_runout, _bearing_runout, own_names=("bearing_runout",), classes=("joint",)
    ),
    "encoder_slip": Kind(
        _draw_slip,
        _encoder_slip,
        needs=("time_s",),
        own_names=("encoder_slip",),
        classes=("time",),
    ),
    "load_creep": Kind(
        _draw_late,
        _load_creep,
        needs=("time_s",),
        loads=True,
        own_names=("load_creep", "creep"),
        classes=("load",),
    ),
    "tracker_wander": Kind(
        _draw_wander,
        _tracker_wander,
        needs=("time_s",),
        own_names=("tracker_wander", "tracker_creep"),
        classes=("time",),
    ),
    "windup": Kind(
        _draw_windup, _windup, needs=("dir",), own_names=("friction_windup",), classes=("approach",)
    ),
    "hardening": Kind(
        _draw_hard,
        _hardening,
        (0.4, 2.5),
        loads=True,
        own_names=("nonlinear_stiffness", "hardening"),
        classes=("load",),
    ),
    "link_bending": Kind(
        _draw_bend,
        _link_bending,
        (0.2, 5.0),
        loads=True,
        own_names=("link_bending", "link_torsion", "tool_bending"),
        classes=("load",),
    ),
    "tracker_creep": Kind(
        _draw_creep,
        _tracker_creep,
        needs=("time_s",),
        own_names=("tracker_creep", "tracker_drift", "fixture_drift"),
        classes=("time",),
    ),
    "station_bump": Kind(
        _draw_bump,
        _station_bump,
        needs=("time_s",),
        registered=True,
        own_names=("tracker_creep", "tracker_drift", "station_shift"),
        classes=("time",),
    ),
    "leaning_column": Kind(
        _draw_lean,
        _leaning_column,
        own_names=("leaning_base", "base_compliance", "leaning_column"),
        classes=("joint", "place", "load"),
    ),
    "fixture_give": Kind(
        _draw_fixture,
        _fixture_give,
        loads=True,
        own_names=("fixture_give", "fixture_compliance", "workpiece_compliance"),
        classes=("load",),
    ),
    "sensor_scale": Kind(
        _draw_scale,
        _sensor_scale,
        own_names=("measuring_scale", "sensor_scale", "scale"),
        classes=("place",),
    ),
    "hose_pull": Kind(
        _draw_hose,
        _hose_pull,
        own_names=("outside_pull", "hose", "cable_force", "hose_pull"),
        classes=("joint", "place", "orientation"),
    ),
}


BEYOND = OUTSIDE | AROUND | UNLISTED
"""Every cause that the contract does not name."""


def kind_of(name: str) -> Kind:
    """Return the kind of an effect of any table."""
    return LIBRARY[name] if name in LIBRARY else BEYOND[name]


def make(name: str, rng: np.random.Generator, robot: RobotClass, rows: Rows) -> Hidden:
    """Return an effect with drawn numbers at strength 1."""
    kind = kind_of(name)
    return Hidden(name, kind.draw(rng, robot, rows), 1.0, kind.change)
