"""Campaigns of a made-up robot, by formulas that share nothing with the product.

Product of exponentials instead of link frames, the equilibrium of the deflected arm by iteration,
masses, stiffness and springs of their own. Only the numbers of the public data sheet are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

G = 9.80665
K0 = np.array([1.58e7, 6.12e6, 5.28e6, 4.66e5, 2.19e5, 3.49e5])
AXES = np.array([[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [0, 1, 0], [-1, 0, 0]], float)
PLACES = np.array(
    [
        [0, 0, 0],
        [0.5, 0, 1.045],
        [1.8, 0, 1.045],
        [1.8, 0, 0.99],
        [2.825, 0, 0.99],
        [3.115, 0, 0.99],
    ]
)
MASSES = np.array([820.0, 480.0, 500.0, 120.0, 40.0, 25.0])
COMS = np.array(
    [
        [0.2, 0, 0.6],
        [1.05, 0.0, 1.05],
        [1.95, 0, 1.2],
        [2.4, 0, 1.0],
        [2.85, 0, 0.99],
        [3.05, 0, 0.99],
    ]
)
R_FLANGE = np.array([[0, 0, 1.0], [0, 1, 0], [-1.0, 0, 0]])
P_TCP = np.array([0.307, 0.0, 0.362])


def turn(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rodrigues, (n, 3, 3)."""
    axis = np.broadcast_to(axis, (*np.shape(angle), 3))
    K = np.zeros((*np.shape(angle), 3, 3))
    K[..., 0, 1], K[..., 0, 2], K[..., 1, 2] = -axis[..., 2], axis[..., 1], -axis[..., 0]
    K = K - np.swapaxes(K, -1, -2)
    s, c = np.sin(angle)[..., None, None], np.cos(angle)[..., None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)


@dataclass
class Truth:
    """One real robot: numbers of the effects that it has."""

    places: np.ndarray = field(default_factory=lambda: PLACES.copy())
    axes: np.ndarray = field(default_factory=lambda: AXES.copy())
    tcp: np.ndarray = field(default_factory=lambda: PLACES[5] + R_FLANGE @ P_TCP)
    reflector: np.ndarray = field(default_factory=lambda: np.zeros(3))
    offsets: np.ndarray = field(default_factory=lambda: np.zeros(6))
    base: tuple[np.ndarray, np.ndarray] = (np.zeros(3), np.zeros(3))
    joint: list[Callable] = field(default_factory=list)
    point: list[Callable] = field(default_factory=list)


def chain(truth: Truth, q: np.ndarray):
    """Screw chain: rotation and shift (n,3,3), (n,3) before each joint and at the end."""
    R = np.broadcast_to(np.eye(3), (len(q), 3, 3))
    t = np.zeros((len(q), 3))
    parts = []
    for i in range(6):
        parts.append((R, t))
        w = truth.axes[i] / np.linalg.norm(truth.axes[i])
        Ri = turn(w, q[:, i])
        ti = truth.places[i] - np.einsum("nij,j->ni", Ri, truth.places[i])
        t = np.einsum("nij,nj->ni", R, ti) + t
        R = R @ Ri
    parts.append((R, t))
    return parts


def move(part, p):
    return np.einsum("nij,j->ni", part[0], p) + part[1]


def levers(truth: Truth, parts, p: np.ndarray):
    """Axes (n,6,3) and arms (n,6,3) from each joint to points (n,3)."""
    w = np.stack([np.einsum("nij,j->ni", parts[i][0], truth.axes[i]) for i in range(6)], 1)
    o = np.stack([move(parts[i], truth.places[i]) for i in range(6)], 1)
    return w, p[:, None, :] - o, o


def solve(truth: Truth, data: Mapping[str, np.ndarray]) -> np.ndarray:
    """Real points (n,3) at the commanded joints."""
    q = data["q"]
    actual = q.copy()
    for _ in range(6):
        parts = chain(truth, actual)
        p = move(parts[6], truth.tcp)
        w, arm, o = levers(truth, parts, p)
        now = {"actual": actual, "parts": parts, "p": p, "w": w, "arm": arm, "o": o, "truth": truth}
        step = sum((f(data, now) for f in truth.joint), np.zeros_like(q))
        actual = q + truth.offsets + step
    parts = chain(truth, actual)
    p = move(parts[6], truth.tcp)
    w, arm, o = levers(truth, parts, p)
    now = {"actual": actual, "parts": parts, "p": p, "w": w, "arm": arm, "o": o, "truth": truth}
    # what is measured may sit beside the tool point, where the loads act
    p = move(parts[6], truth.tcp + R_FLANGE @ truth.reflector)
    p = p + sum((f(data, now) for f in truth.point), np.zeros_like(p))
    angles, shift = truth.base
    size = np.linalg.norm(angles) + 1e-300
    return p @ turn(angles / size, np.array(size)).T + shift


def load_torque(data, now) -> np.ndarray:
    F, M = data["wrench"][:, None, :3], data["wrench"][:, None, 3:]
    return np.sum(now["w"] * (np.cross(now["arm"], F) + M), -1)


def weight(now, masses, coms) -> np.ndarray:
    tau = np.zeros_like(now["actual"])
    for k in range(6):
        c = move(now["parts"][k + 1], coms[k])
        arm = c[:, None] - now["o"]
        force = np.array([0, 0, -masses[k] * G])
        tau[:, : k + 1] += np.sum(now["w"] * np.cross(arm, force), -1)[:, : k + 1]
    return tau


def campaign(rng: np.random.Generator, n: int, repeats: int = 30, span: float = 1.0) -> dict:
    """Conditions of n rows, some poses measured again."""
    low = np.radians([-60, -115, 10, -170, -100, -170])
    high = np.radians([60, -15, 120, 170, 100, 170])
    mid = 0.5 * (low + high)
    low, high = mid + span * (low - mid), mid + span * (high - mid)
    q = rng.uniform(low, high, (n, 6))
    wrench = np.zeros((n, 6))
    loaded = rng.random(n) < 0.7
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    wrench[:, :3] = direction * rng.uniform(200, 1500, (n, 1)) * loaded[:, None]
    data = {
        "q": q,
        "wrench": wrench,
        "direction": rng.choice([-1.0, 1.0], (n, 6)),
        "qd": np.radians(rng.uniform(-15, 15, (n, 6))) * (rng.random((n, 1)) < 0.6),
        "time": np.cumsum(rng.uniform(10, 30, n)),
    }
    data["temp"] = (
        21 + 9 * (1 - np.exp(-data["time"] / data["time"][-1] * 2)) + rng.normal(0, 1.0, n)
    )
    if not repeats:
        return data
    source = rng.choice(n, max(1, repeats // 5), replace=False)
    for row in rng.choice(np.setdiff1d(np.arange(n), source), repeats, replace=False):
        of = source[row % len(source)]
        for name in ("q", "wrench", "direction", "qd", "temp"):
            data[name][row] = data[name][of]
    return data


def effect(name: str, rng: np.random.Generator) -> Callable[[Truth, float], None]:
    """A cause by name; the returned function puts ``size`` times its numbers into a robot."""
    return EFFECTS[name](rng)


def _base(rng):
    a, t = rng.normal(0, 3e-4, 3), rng.normal(0, 5e-4, 3)

    def put(truth, size):
        truth.base = (truth.base[0] + size * a, truth.base[1] + size * t)

    return put


def _tool(rng):
    c = rng.normal(0, 5e-4, 3)

    def put(truth, size):
        truth.tcp = truth.tcp + size * c

    return put


def _offset(rng):
    some = rng.normal(0, 3e-4, 6) * (rng.random(6) < 0.7)
    some[rng.integers(1, 5)] = 5e-4

    def put(truth, size):
        truth.offsets = truth.offsets + size * some

    return put


def _geometry(rng):
    lengths, tilt = rng.normal(0, 4e-4, (6, 3)), rng.normal(0, 2e-4, (6, 3))
    lengths[0] = tilt[0] = 0

    def put(truth, size):
        truth.places = truth.places + size * np.cumsum(lengths, 0)
        truth.tcp = truth.tcp + size * lengths.sum(0)
        truth.axes = truth.axes + size * np.cross(tilt, truth.axes)

    return put


def _joint(make):
    def outer(rng):
        law = make(rng)

        def put(truth, size):
            truth.joint.append(lambda data, now: size * law(data, now))

        return put

    return outer


def _point(make):
    def outer(rng):
        law = make(rng)

        def put(truth, size):
            truth.point.append(lambda data, now: size * law(data, now))

        return put

    return outer


def _compliance(rng):
    c = 1 / (K0 * np.exp(rng.normal(0, 0.4, 6)))
    return lambda d, now: c * load_torque(d, now)


def _late(rng):
    """A relaxation that every earlier load has its share in, written out as a sum."""
    c = rng.uniform(0.3, 1.0, 6) / K0
    fade = rng.uniform(500.0, 1500.0)

    def law(d, now):
        t = d["time"]
        before = np.concatenate([t[:1], t[:-1]])
        since, until = t[:, None] - before, t[:, None] - t
        share = np.where(until >= 0, np.exp(-until / fade) - np.exp(-since / fade), 0.0)
        return c * (share @ load_torque(d, now))

    return law


def _sag(rng):
    m = MASSES * np.exp(rng.normal(0, 0.25, 6))
    coms = COMS + rng.normal(0, 0.06, (6, 3)) * [1, 0.3, 1]
    c = 1 / (K0 * np.exp(rng.normal(0, 0.3, 6)))
    return lambda d, now: c * weight(now, m, coms)


def _variable(rng):
    a, phase = rng.uniform(0.3, 0.7, 6), rng.uniform(0, 6.28, 6)
    order = rng.choice([1, 2], 6)
    a[rng.choice(6, 3, replace=False)] *= 0.1

    def law(d, now):
        change = np.exp(a * np.sin(order * now["actual"] + phase))
        return (change - np.i0(a)) / K0 * load_torque(d, now)

    return law


def _backlash(rng):
    b = rng.uniform(0.3, 1, 6) * 1.5e-4 * (rng.random(6) < 0.6)
    b[rng.integers(0, 3)] = 2e-4
    return lambda d, now: b * d["direction"]


def _encoder(rng):
    """Two main joints that count wrongly, one of them by more."""
    scale = np.zeros(6)
    scale[rng.choice(3, 2, replace=False)] = rng.uniform(1e-4, 3e-4, 2) * rng.choice([-1, 1], 2)
    return lambda d, now: scale * d["q"]


def _runout(rng):
    """A bearing on an eccentric seat: the axis goes round once per turn, in what carries it."""
    joint = rng.integers(0, 3)
    cosine, sine = rng.normal(0, 1e-4, (2, 3))

    def law(d, now):
        angle = now["actual"][:, joint, None]
        shift = np.cos(angle) * cosine + np.sin(angle) * sine
        return np.einsum("nij,nj->ni", now["parts"][joint][0], shift)

    return law


def _wave(rng):
    joints = rng.choice(3, rng.integers(1, 3), replace=False)
    orders = rng.choice([2, 3, 4, 6, 8, 17, 24, 36], len(joints))
    phase = rng.uniform(0, 6.28, len(joints))

    def law(d, now):
        out = np.zeros_like(d["q"])
        for j, n, f in zip(joints, orders, phase, strict=True):
            out[:, j] += 1.5e-4 * np.sin(n * now["actual"][:, j] + f)
        return out

    return law


def _thermal(rng):
    drift = rng.normal(0, 1e-5, 6) * [0.2, 1, 1, 0.3, 0.3, 0]

    def put(truth, size):
        def law(d, now):
            warm = (d["temp"] - d["temp"][0])[:, None]
            return size * 1.2e-5 * warm * now["p"]

        truth.point.append(law)
        truth.joint.append(lambda d, now: size * (d["temp"] - d["temp"][0])[:, None] * drift)

    return put


def _lag(rng):
    T = rng.uniform(0.5, 1.5, 6) * 1e-3
    return lambda d, now: -T * d["qd"]


def _coupling(rng):
    c54, c64, c65 = rng.normal(0, 4e-4, 3)

    def law(d, now):
        out = np.zeros_like(d["q"])
        out[:, 4] = c54 * d["q"][:, 3]
        out[:, 5] = c64 * d["q"][:, 3] + c65 * d["q"][:, 4]
        return out

    return law


def _payload(rng):
    m = 40 * rng.choice([-1, 1]) * rng.uniform(0.5, 1.5)
    place = np.array([3.115, 0, 0.99]) + R_FLANGE @ rng.normal(0, 0.15, 3) + [0.2, 0, 0]

    def law(d, now):
        c = move(now["parts"][6], place)
        return np.sum(now["w"] * np.cross(c[:, None] - now["o"], [0, 0, -m * G]), -1) / K0

    return law


def _spring(rng):
    phi, ratio = rng.uniform(-2.2, -0.9), rng.uniform(0.15, 0.3)

    def law(d, now):
        q = now["actual"][:, 1] - phi
        s = np.sqrt(1 + ratio**2 + 2 * ratio * np.cos(q))
        out = np.zeros_like(d["q"])
        out[:, 1] = 3e-4 * np.sin(q) * (1 - 0.6 / s) / 0.4
        return out

    return law


def _windup(rng):
    m, c = MASSES, rng.uniform(0.5, 1.5, 6) / K0

    def law(d, now):
        tau = np.abs(weight(now, m, COMS) + load_torque(d, now))
        return 0.15 * d["direction"] * c * tau

    return law


def _hardening(rng):
    def law(d, now):
        tau = load_torque(d, now)
        size = np.abs(tau) / np.sqrt(np.mean(tau**2, 0) + 1)
        return tau / K0 / (1 + 0.8 * size)

    return law


def _bending(rng):
    c = rng.uniform(0.5, 2, (3, 3)) * 2e-7

    def law(d, now):
        out = np.zeros_like(now["p"])
        for k, (a, b) in enumerate(((1, 2), (2, 4), (0, 1))):
            mid = 0.5 * (now["o"][:, a] + now["o"][:, b])
            M = np.cross(now["p"] - mid, d["wrench"][:, :3])
            R = now["parts"][a + 1][0]
            angle = np.einsum("nij,nj->ni", R, c[k] * np.einsum("nji,nj->ni", R, M))
            out += np.cross(angle, now["p"] - mid)
        return out

    return law


def _creep(rng):
    v, w = rng.normal(0, 2e-4, 3), rng.normal(0, 5e-5, 3)

    def law(d, now):
        s = (d["time"] / d["time"][-1])[:, None] ** 0.7
        return s * (v + np.cross(w, now["p"]))

    return law


def _lean(rng):
    c = rng.uniform(0.5, 1.5) * 3e-8

    def law(d, now):
        M = np.zeros_like(now["p"])
        for k in range(6):
            arm = move(now["parts"][k + 1], COMS[k])
            M += np.cross(arm, [0, 0, -MASSES[k] * G])
        M += np.cross(now["p"], d["wrench"][:, :3])
        M[:, 2] = 0
        return np.cross(c * M, now["p"])

    return law


def _step(rng):
    v, at = rng.normal(0, 3e-4, 3), rng.uniform(0.3, 0.7)
    return lambda d, now: (d["time"] > at * d["time"][-1])[:, None] * v


def _stretch(rng):
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    return lambda d, now: 1e-4 * ((now["p"] - now["p"].mean(0)) @ way)[:, None] * way


def _hose(rng):
    hook = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-1.5, 1.5), 3.5])

    def law(d, now):
        end = move(now["parts"][6], np.array([3.115, 0, 0.99]))
        pull = 300.0 * (hook - end) * (1.0 - 0.8 / np.linalg.norm(hook - end, axis=1))[:, None]
        return np.sum(now["w"] * np.cross(end[:, None] - now["o"], pull[:, None]), -1) / K0

    return law


def _fixture(rng):
    A = rng.normal(size=(3, 3))
    C, slope = 1e-7 * (A @ A.T), rng.normal(0, 0.8, 3)

    def law(d, now):
        soft = np.exp((now["p"] - now["p"].mean(0)) @ slope)
        return soft[:, None] * (d["wrench"][:, :3] @ C)

    return law


EFFECTS = {
    "base_frame": _base,
    "tool_frame": _tool,
    "joint_offset": _offset,
    "link_geometry": _geometry,
    "joint_compliance": _joint(_compliance),
    "gravity_sag": _joint(_sag),
    "variable_stiffness": _joint(_variable),
    "backlash": _joint(_backlash),
    "transmission_error": _joint(_wave),
    "thermal_drift": _thermal,
    "servo_lag": _joint(_lag),
    "gear_coupling": _joint(_coupling),
    "payload_error": _joint(_payload),
    "counterbalance": _joint(_spring),
    "encoder_scale": _joint(_encoder),
    "load_creep": _joint(_late),
    "bearing_runout": _point(_runout),
}
OUTSIDE = {
    "windup": _joint(_windup),
    "hardening": _joint(_hardening),
    "bending": _point(_bending),
    "creep": _point(_creep),
    "lean": _point(_lean),
    "step": _point(_step),
    "stretch": _point(_stretch),
    "hose": _joint(_hose),
    "fixture": _point(_fixture),
}
EFFECTS |= OUTSIDE


def displacement(putters, sizes, data) -> np.ndarray:
    truth = Truth()
    for put, size in zip(putters, sizes, strict=True):
        put(truth, size)
    return solve(truth, data) - solve(Truth(), data)


def scaled(put, data, rms: float) -> float:
    """Factor that makes one cause rms [m] large over the rows."""
    probe = displacement([put], [0.1], data)
    return 0.1 * rms / np.sqrt(np.mean(np.sum(probe**2, 1)))


def make(
    seed: int,
    causes: Mapping[str, float],
    n: int = 300,
    noise: float = 2e-5,
    background: float = 0.0,
    outliers: float = 0.0,
    span: float = 1.0,
    repeats: int = 30,
):
    """Rows of a campaign, fresh rows without noise, for causes {name: rms in m}.

    Returns (data, measured, fresh data, fresh points).
    """
    rng = np.random.default_rng(seed)
    data, fresh = campaign(rng, n, repeats, span), campaign(rng, 200, 5, span)
    fresh["temp"][0] = data["temp"][0]
    wanted = dict(causes)
    if background:
        wanted |= {k: background for k in ("base_frame", "tool_frame") if k not in wanted}
    putters = [effect(name, rng) for name in wanted]
    sizes = [scaled(put, data, rms) for put, rms in zip(putters, wanted.values(), strict=True)]
    truth = Truth()
    for put, size in zip(putters, sizes, strict=True):
        put(truth, size)
    measured = solve(truth, data) + rng.normal(0, noise, (n, 3))
    bad = rng.random(n) < outliers
    measured[bad] += rng.normal(0, 1e-3, (int(bad.sum()), 3))
    return data, measured, fresh, solve(truth, fresh)


def csv(data, measured, leave_out: tuple[str, ...] = ()) -> str:
    """The rows as a measurement file."""
    blocks = {
        "q": ([f"q{i}_deg" for i in range(1, 7)], np.degrees(data["q"]), "%.6f"),
        "point": (["x_mm", "y_mm", "z_mm"], measured * 1e3, "%.5f"),
        "wrench": (
            ["fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm"],
            data["wrench"],
            "%.3f",
        ),
        "direction": ([f"dir{i}" for i in range(1, 7)], data["direction"], "%d"),
        "qd": ([f"qd{i}_deg_s" for i in range(1, 7)], np.degrees(data["qd"]), "%.6f"),
        "time": (["time_s"], data["time"][:, None], "%.1f"),
        "temp": (["temp_C"], data["temp"][:, None], "%.2f"),
    }
    kept = [b for name, b in blocks.items() if name not in leave_out]
    lines = [",".join(["id", *(n for names, _, _ in kept for n in names)])]
    for row in range(len(measured)):
        cells = [fmt % value for _, values, fmt in kept for value in values[row]]
        lines.append(",".join([f"p{row}", *cells]))
    return "\n".join(lines) + "\n"
