"""Hidden causes around the arm (instrument, tools, fixtures, rail), and some in no library.

Those of logged columns read ``Rows.marks``. The last table holds faults that no list has: right is
to say so, or to name the class.
"""

from __future__ import annotations

import numpy as np

from tools.blind.campaign import Rows
from tools.blind.chain import JOINTS, Array, Geometry, embed, sweep
from tools.blind.effects import Kind, some
from tools.blind.robots import RobotClass
from tools.blind.world import State

RAIL = 4000.0
"""Length of the rail [mm]."""


def _draw_frames(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {"shift": rng.normal(0, 3e-4, (3, 3)), "turn": rng.normal(0, 1e-4, (3, 3))}


def _tool_frames(state: State, x: dict[str, Array], s: float) -> None:
    state.tool = state.tool + s * x["shift"][_label(state, "tool_no")]


def _fixture_frames(state: State, x: dict[str, Array], s: float) -> None:
    at = _label(state, "fixture")
    state.after.append(lambda p: s * (x["shift"][at] + np.cross(x["turn"][at], p)))


def _pressure_shift(state: State, x: dict[str, Array], s: float) -> None:
    """Shift the tool with the pressure in its pneumatic clamp."""
    low = state.rows.marks["pressure_bar"] < 6.0
    state.tool = state.tool + s * low[:, None] * x["shift"][0]


def _label(state: State, name: str) -> Array:
    return state.rows.marks[name].astype(int) - 1


def _draw_rail(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "bow": rng.normal(0, 2e-4, (2, 2)),
        "phase": rng.uniform(0, 2 * np.pi, 2),
        "turn": rng.normal(0, 1.5e-4, 3),
        "scale": rng.choice([-1.0, 1.0], 1) * rng.uniform(5e-5, 2e-4, 1),
    }


def _along(state: State) -> Array:
    return state.rows.marks["e1_mm"] / RAIL


def _rail_straightness(state: State, x: dict[str, Array], s: float) -> None:
    part = _along(state)
    waves = np.stack([np.sin((k + 1) * np.pi * part + x["phase"][k]) for k in range(2)], axis=1)
    across = np.column_stack([np.zeros(len(part)), waves @ x["bow"]])
    state.after.append(lambda p: s * across)


def _rail_angle(state: State, x: dict[str, Array], s: float) -> None:
    """Pitch, roll and yaw of the carriage, a little bent along the way."""
    part = _along(state) - 0.5
    size = (part + 0.3 * part**2)[:, None]
    state.after.append(lambda p: s * np.cross(2.0 * size * x["turn"], p))


def _rail_scale(state: State, x: dict[str, Array], s: float) -> None:
    way = s * x["scale"][0] * (_along(state) - 0.5) * RAIL * 1e-3
    state.after.append(lambda p: way[:, None] * np.array([1.0, 0.0, 0.0]))


def _draw_mount(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "shift": rng.normal(0, 1.5e-4, 3),
        "share": rng.uniform(0.2, 0.9, 1),
        "step": rng.integers(0, 2, 1).astype(float),
    }


def _reflector_creep(state: State, x: dict[str, Array], s: float) -> None:
    """Let the reflector creep or slip in its mount, in the tool's axes; the loads stay."""
    part = state.rows.time / max(state.rows.time[-1], 1.0)
    step = (part > x["share"][0]).astype(float)
    size = step if x["step"][0] else 1.0 - np.exp(-part / x["share"][0])
    state.reflector = state.reflector + s * size[:, None] * x["shift"]


def _draw_click(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    way = rng.normal(size=3)
    return {
        "way": way / np.linalg.norm(way),
        "shift": rng.normal(0, 4e-4, 3),
        "rare": rng.uniform(0.88, 0.95, 1),
    }


def _load_click(state: State, x: dict[str, Array], s: float) -> None:
    """Let a mount give way where the load pulls hard in one sense: a few rows only."""
    pull = state.rows.force @ x["way"]
    hard = pull > np.quantile(pull, x["rare"][0])
    state.tool = state.tool + s * hard[:, None] * x["shift"]


def _draw_crash(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    turn = rng.normal(0, 4e-4, 6) * np.array([0, 0, 0, 0, 1, 1])
    return {"shift": rng.normal(0, 4e-4, 3), "turn": turn, "when": rng.uniform(0.85, 0.95, 1)}


def _crash(state: State, x: dict[str, Array], s: float) -> None:
    late = (state.rows.time > x["when"][0] * state.rows.time[-1])[:, None]
    state.tool = state.tool + s * late * x["shift"]
    state.theta[:, JOINTS] += s * late * x["turn"]


# In no library


def _draw_any(rng: np.random.Generator, robot: RobotClass, rows: Rows) -> dict[str, Array]:
    return {
        "a": rng.normal(0, 1.0, 6),
        "phase": rng.uniform(0, 2 * np.pi, 6),
        "joint": rng.integers(0, 4, 1).astype(float),
        "mask": some(rng, 1, 2, 4),
    }


def _loose_flange(state: State, x: dict[str, Array], s: float) -> None:
    """Tilt the tool to the side where its weight hangs, with a click."""
    n = len(state.rows.q)
    poses = sweep(Geometry.of(state.robot.arm, n), embed(state.rows.q))
    down = -poses.flange_turn[:, 2, :2]
    tilt = np.column_stack([-np.tanh(6 * down[:, 1]), np.tanh(6 * down[:, 0]), np.zeros(n)])
    state.tool = state.tool + s * 3e-4 * np.cross(tilt, state.robot.tool)


def _crossed_ripple(state: State, x: dict[str, Array], s: float) -> None:
    """Let gears of the hollow wrist ripple in A5 and A6 with the angle of A4."""
    wave = np.sin(7.0 * state.rows.q[:, 3] + x["phase"][0])
    state.theta[:, JOINTS[4:]] += s * 4e-4 * wave[:, None] * x["a"][:2]


def _bearing_dent(state: State, x: dict[str, Array], s: float) -> None:
    """Lift what a joint carries where its bearing has a dent."""
    q = state.rows.q[:, int(x["joint"][0])]
    bump = np.exp(-0.5 * ((q - np.quantile(q, 0.3)) / (0.12 * np.std(q) + 0.05)) ** 2)
    state.after.append(lambda p: s * 5e-4 * bump[:, None] * x["a"][:3])


def _air_bend(state: State, x: dict[str, Array], s: float) -> None:
    """Bend the beam of the tracker in warm air: with the square of the distance, upwards."""
    stand = np.array([3.0, 2.0 * np.sign(x["a"][0]), 0.0])
    state.after.append(
        lambda p: s * 3e-5 * np.sum((p - stand) ** 2, axis=1)[:, None] * np.array([0.2, 0, 1])
    )


def _dress_pack(state: State, x: dict[str, Array], s: float) -> None:
    """Let a hose wound on the forearm twist the wrist when it tightens."""
    q = state.rows.q
    tight = np.maximum(np.abs(q[:, 3] + 0.6 * q[:, 5] + 0.5 * x["a"][0]) - 1.2, 0.0)
    state.theta[:, JOINTS[3:]] += s * 3e-4 * (tight**1.5)[:, None] * x["a"][1:4]


def _linkage(state: State, x: dict[str, Array], s: float) -> None:
    """Turn A3 with what A2 and A3 are together, as a parallelogram out of true does."""
    q = state.rows.q
    state.theta[:, JOINTS[2]] += s * 3e-4 * np.sin(2.0 * (q[:, 1] + q[:, 2]) + x["phase"][0])


_RAIL = ("rail", "e1")
AROUND: dict[str, Kind] = {
    "tool_frames": Kind(
        _draw_frames, _tool_frames, needs=("tool_no",), own_names=("tool_frames",), classes=()
    ),
    "fixture_frames": Kind(
        _draw_frames, _fixture_frames, needs=("fixture",), own_names=("fixture_frames",)
    ),
    "pressure_shift": Kind(_draw_frames, _pressure_shift, needs=("pressure_bar",)),
    "rail_straightness": Kind(
        _draw_rail, _rail_straightness, needs=("e1_mm",), own_names=("rail_straightness", *_RAIL)
    ),
    "rail_angle": Kind(_draw_rail, _rail_angle, needs=("e1_mm",), own_names=("rail_angle", *_RAIL)),
    "rail_scale": Kind(_draw_rail, _rail_scale, needs=("e1_mm",), own_names=("rail_scale", *_RAIL)),
    "reflector_creep": Kind(
        _draw_mount,
        _reflector_creep,
        needs=("time_s",),
        own_names=("reflector_creep",),
        classes=("time", "orientation"),
    ),
    "load_click": Kind(_draw_click, _load_click, loads=True, classes=("load", "orientation")),
    "crash": Kind(
        _draw_crash, _crash, needs=("time_s",), own_names=("encoder_slip",), classes=("time",)
    ),
}
"""Causes of instrument, tools, fixtures, rail, and of accidents."""
UNLISTED: dict[str, Kind] = {
    "loose_flange": Kind(_draw_any, _loose_flange, classes=("orientation", "joint", "load")),
    "crossed_ripple": Kind(_draw_any, _crossed_ripple, classes=("joint", "orientation")),
    "bearing_dent": Kind(_draw_any, _bearing_dent, classes=("joint", "place")),
    "air_bend": Kind(_draw_any, _air_bend, classes=("place",)),
    "dress_pack": Kind(_draw_any, _dress_pack, classes=("joint", "orientation")),
    "linkage": Kind(_draw_any, _linkage, classes=("joint",)),
}
"""Causes that no library holds."""
