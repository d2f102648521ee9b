"""Hidden causes: what they do to joints and tool in fine steps of time, and their truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tools.blind.chain import Array
from tools.blind.traces.robot import FINE

DEG = np.pi / 180.0


@dataclass
class Motion:
    """Signals in fine steps: command and actual joints (n, 6), tool shift (n, 3), Jacobian."""

    time: Array
    command: Array
    actual: Array
    shift: Array
    point: Array
    jacobian: Array
    clock: float = 0.0
    truth: dict[str, Any] = field(default_factory=dict)


def late(signal: Array, delay: float) -> Array:
    """Return a signal (n, ...) so much later; before its start it stands."""
    at = np.arange(len(signal)) - delay / FINE
    return np.stack([np.interp(at, np.arange(len(signal)), column) for column in signal.T], axis=1)


def controller_delay(m: Motion, rng: np.random.Generator) -> None:
    """Shift all joints."""
    delay = rng.uniform(4e-3, 30e-3)
    m.actual = late(m.actual, delay)
    m.truth["controller_delay"] = {"delay_ms": 1e3 * delay}


def servo_lag(m: Motion, rng: np.random.Generator) -> None:
    """Let each joint follow by dead time, a first-order or a second-order loop."""
    kind = rng.choice(["dead", "first", "second"])
    delays = rng.uniform(3e-3, 25e-3, 6)
    if kind == "dead" and rng.random() < 0.3:
        delays -= 12e-3
    for k, delay in enumerate(delays):
        x = m.actual[:, k]
        if kind == "dead":
            m.actual[:, k] = late(x[:, None], delay)[:, 0]
        elif kind == "first":
            decay, middle = float(np.exp(-FINE / delay)), 0.5 * (x[1:] + x[:-1])
            y = [float(x[0])]
            for goal in middle.tolist():
                y.append(goal + (y[-1] - goal) * decay)
            m.actual[:, k] = y
        else:
            damping = 0.8
            w = 2.0 * damping / delay
            y, v = float(x[0]), 0.0
            out = []
            fine = FINE / 4
            for now, then in zip(x.tolist(), [*x[1:].tolist(), float(x[-1])], strict=True):
                out.append(y)
                for share in (0.125, 0.375, 0.625, 0.875):
                    # the middle of a step, so that the step adds no delay
                    middle = y + 0.5 * fine * v
                    goal = now + share * (then - now)
                    v += fine * (w * w * (goal - middle) - 2.0 * damping * w * v)
                    y += fine * v
            m.actual[:, k] = out
    m.truth["servo_lag"] = {"delay_ms": (1e3 * delays).tolist(), "kind": str(kind)}


def reversal_error(m: Motion, rng: np.random.Generator) -> None:
    """Let some joints stay behind after a reversal: play, a spike, or both."""
    joints = rng.choice(3, size=rng.integers(1, 4), replace=False)
    kind = rng.choice(["play", "spike", "both"])
    half, spike = np.zeros(6), np.zeros(6)
    length = rng.uniform(0.05, 0.2)
    shape = rng.choice(["decay", "bump"])
    for k in joints:
        x = m.command[:, k]
        half[k] = rng.uniform(0.006, 0.03) * DEG if kind != "spike" else 0.0
        spike[k] = rng.uniform(0.01, 0.05) * DEG if kind != "play" else 0.0
        sign, since, now, extreme = np.zeros(len(x)), np.full(len(x), 1e9), 0.0, x[0]
        turned = -1e9
        for i, value in enumerate(x):
            step = value - extreme
            if now == 0.0 or step * now < 0.0:
                if abs(step) > 5e-5:
                    if now != 0.0:
                        turned = m.time[i]
                    now, extreme = np.sign(step), value
            else:
                extreme = value
            sign[i], since[i] = now, m.time[i] - turned
        if shape == "decay":
            course = np.exp(-since / (0.4 * length))
        else:
            course = np.where(since < length, np.sin(np.pi * np.minimum(since / length, 1.0)), 0.0)
        m.actual[:, k] -= sign * (half[k] + spike[k] * course)
    m.truth["reversal_error"] = {
        "half_gap_deg": (half / DEG).tolist(),
        "spike_deg": (spike / DEG).tolist(),
        "shape": str(shape),
    }


def vibration(m: Motion, rng: np.random.Generator) -> None:
    """Let the tool swing: a mode that the path drives, or a forced line while it moves."""
    kind = rng.choice(["mode", "mode", "forced"])
    frequency = rng.uniform(5.0, 22.0)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    if kind == "mode":
        damping, gain = rng.uniform(0.01, 0.04), rng.uniform(1.0, 3.0)
        w = 2.0 * np.pi * frequency
        rate = np.gradient(np.gradient(m.point @ direction, FINE), FINE)
        y, v = 0.0, 0.0
        out = np.empty(len(rate))
        for i, a in enumerate(rate):
            v += FINE * (-w * w * y - 2.0 * damping * w * v - gain * a)
            y += FINE * v
            out[i] = y
    else:
        moving = np.linalg.norm(np.gradient(m.point, FINE, axis=0), axis=1) > 1e-3
        moving &= moving  # the force is there while the tool cuts
        size = rng.uniform(0.02, 0.1) * 1e-3
        out = size * np.sin(2.0 * np.pi * frequency * m.time + rng.uniform(0, 6.28)) * moving
    m.shift += out[:, None] * direction
    size = float(np.quantile(np.abs(out), 0.999))
    m.truth["vibration"] = {
        "frequency_Hz": frequency,
        "amplitude_mm": 1e3 * size,
        "kind": str(kind),
    }


def clock_offset(m: Motion, rng: np.random.Generator) -> None:
    """Stamp the tracker's readings late or early."""
    m.clock = rng.uniform(-0.15, 0.15)
    m.truth["clock_offset"] = {"offset_ms": 1e3 * m.clock}


def ripple(m: Motion, rng: np.random.Generator) -> None:
    """Gear ripple over the joints' angles: in no library of paths."""
    for k in rng.choice(5, size=2, replace=False):
        order = rng.integers(15, 60)
        m.actual[:, k] += (
            rng.uniform(0.003, 0.015) * DEG * np.sin(order * m.command[:, k] + rng.uniform(0, 6.28))
        )
    m.truth["outside"] = {"kind": "ripple"}


def scale(m: Motion, rng: np.random.Generator) -> None:
    """A joint that turns too far in proportion: no effect of the library."""
    k = rng.integers(0, 3)
    m.actual[:, k] += rng.uniform(0.003, 0.01) * (m.command[:, k] - m.command[0, k])
    m.truth["outside"] = {"kind": "scale"}


def drift(m: Motion, rng: np.random.Generator) -> None:
    """A joint that creeps with time: no effect of the library."""
    k = rng.integers(0, 5)
    m.actual[:, k] += rng.uniform(0.005, 0.02) * DEG * (1.0 - np.exp(-m.time / 5.0))
    m.truth["outside"] = {"kind": "drift"}


def sag(m: Motion, rng: np.random.Generator) -> None:
    """Standing error that follows the place, as of a slack position loop."""
    reach = np.linalg.norm(m.point[:, :2], axis=1)
    m.actual[:, 1] += rng.uniform(0.05, 0.2) * DEG * (reach - reach[0])
    m.actual[:, 1] += 0.01 * DEG
    m.truth["outside"] = {"kind": "sag"}


EFFECTS: dict[str, Callable[[Motion, np.random.Generator], None]] = {
    "servo_lag": servo_lag,
    "controller_delay": controller_delay,
    "reversal_error": reversal_error,
    "vibration": vibration,
    "clock_offset": clock_offset,
}
OUTSIDE = (ripple, scale, drift, sag)
