"""Recordings of known functions: closed forms, so that what comes out is known exactly."""

import numpy as np

HEAD = ["time_s", *(f"q{k}_cmd_deg" for k in range(1, 7)), *(f"q{k}_act_deg" for k in range(1, 7))]
START = np.array([5.0, -80.0, 100.0, 10.0, 50.0, 8.0])
SIZE = np.array([6.0, 4.0, -5.0, 3.0, 4.0, -6.0])
TURNS = (1.0, 3.2, 4.5, 7.1, 8.0, 10.3, 12.6)
"""Where each move begins [s]; each lasts 0.9 s, to and fro."""


def place(t):
    """How far along (n,) at times (n,): moves with a bounded jerk, to 1 and back in turn."""
    far = np.zeros_like(t)
    for k, begin in enumerate(TURNS):
        x = np.clip((t - begin) / 0.9, 0.0, 1.0)
        far += (-1) ** k * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    return far


def command(t, shift=0.0):
    """Joint angles (n, 6) [deg]; neighbours begin 50 ms after each other."""
    later = 0.05 * np.arange(6)
    delays = np.broadcast_to(shift, 6)
    ways = [place(t - later[k] - delays[k]) for k in range(6)]
    return START + SIZE * np.stack(ways, axis=1)


def rows(actual, cycle=0.004, sigma=2e-4, seed=3):
    """Time, command and ``actual(t)`` (n, 6) with noise, as a table (n, 13)."""
    t = np.arange(0.0, 14.5, cycle)
    noise = np.random.default_rng(seed).normal(0.0, sigma, (len(t), 6))
    return np.column_stack([t, command(t), actual(t) + noise])


def written(path, table, head=None, more=()):
    """Write a table as CSV and return its path."""
    lines = [",".join([*(head or HEAD), *more])]
    lines += [",".join(f"{v:.6f}" for v in row) for row in table]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
