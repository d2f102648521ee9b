"""Write the campaign of ``fixtures/drift_campaign``: a KR 500 measured for two hours.

Run: python -m tools.dev.make_campaign    (the output is the same bytes every time)

The robot is ``hidden_twin.Twin``, which shares no code with the product: joints that give under
load as Jiao et al. 2022 identified them, A2 and A5 mounted a few hundredths of a degree off, and a
tracker whose stand creeps. Every fourth posture is read without load, ten are read again later.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tools.dev.hidden_twin import Twin

CASE = Path(__file__).resolve().parents[2] / "fixtures" / "drift_campaign"
POSTURES, REPEATS = 60, 10
OFFSETS_DEG = np.array([0.0, 0.03, 0.0, 0.0, -0.04, 0.0])
CREEP_MM_PER_H = np.array([0.05, -0.03, 0.06])
NOISE = 12e-6
"""Of a tracker reading, per axis [m]."""
SECONDS = 45.0
LOW = np.radians([-35.0, -85.0, 70.0, -90.0, -80.0, -120.0])
HIGH = np.radians([35.0, -45.0, 115.0, 90.0, -20.0, 120.0])


def campaign(seed: int = 20) -> str:
    """Return the rows as CSV text."""
    rng = np.random.default_rng(seed)
    twin = Twin()
    fresh = np.round(np.degrees(rng.uniform(LOW, HIGH, (POSTURES, 6))), 3)
    order = np.concatenate([np.repeat(np.arange(POSTURES), 2), rng.permutation(POSTURES)[:REPEATS]])
    q = np.radians(fresh[order])
    n = len(order)
    force = rng.normal(size=(n, 3)) * np.array([250.0, 250.0, 450.0])
    force[::2] = 0.0
    force[2 * POSTURES :] = 0.0
    force = np.round(force, 1)
    time = np.round(np.arange(n) * SECONDS + rng.uniform(0.0, 8.0, n), 1)
    creep = time[:, None] / 3600.0 * CREEP_MM_PER_H * 1e-3
    real = q + np.radians(OFFSETS_DEG)
    points = twin.loaded_point(real, force, twin.tcp) + creep + rng.normal(0.0, NOISE, (n, 3))
    names = ["id", "group", *(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm", "time_s"]
    names += ["fx_N", "fy_N", "fz_N"]
    lines = [",".join(names)]
    for row in range(n):
        values = [f"{v:.3f}" for v in np.degrees(q[row])] + [f"{v * 1e3:.4f}" for v in points[row]]
        values += [f"{time[row]:.1f}", *(f"{v:.1f}" for v in force[row])]
        lines.append(",".join([f"R{row + 1:03d}", f"P{order[row] + 1:02d}", *values]))
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the file."""
    CASE.mkdir(parents=True, exist_ok=True)
    (CASE / "measured.csv").write_text(campaign(), encoding="ascii", newline="")


if __name__ == "__main__":
    main()
