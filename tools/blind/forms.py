"""Forms of readings: what an instrument tells of the tool point, as columns of the file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tools.blind.campaign import Rows
from tools.blind.chain import Array, Dimensions, Geometry, columns, embed, sweep

Cells = dict[str, list[str]]
XYZ = ("x_mm", "y_mm", "z_mm")
FORMS = ("xyz", "sigmas", "gaps", "camera", "dial", "ballbar", "wire", "mixed", "plane")
"""Three coordinates; with sigmas of their own; temperatures missing; two coordinates; one along a
direction; distance from a known point; from unknown ones; of all sorts; contact with planes."""


def read(form: str, points: Array, noise: Array, rng: np.random.Generator) -> Cells:
    """Return the reading columns for points (n, 3) and their noise (n, 3) [m]."""
    if form == "sigmas":
        spread = np.exp(rng.normal(0.0, 0.6, noise.shape))
        sigma = spread * np.std(noise)
        return _xyz(points + noise * spread) | _cells(("sx_mm", "sy_mm", "sz_mm"), sigma)
    seen = points + noise
    if form in _READ:
        return _READ[form](seen, rng)
    return _xyz(seen)


def _xyz(points: Array) -> Cells:
    return _cells(XYZ, points)


def _cells(names: tuple[str, ...], values: Array, unit: float = 1e3) -> Cells:
    columns = np.reshape(values, (len(values), -1)).T
    return {
        name: [f"{unit * v:z.5f}" for v in column]
        for name, column in zip(names, columns, strict=True)
    }


def _camera(seen: Array, rng: np.random.Generator) -> Cells:
    return _xyz(seen) | {"z_mm": [""] * len(seen)}


def _dial(seen: Array, rng: np.random.Generator) -> Cells:
    way = rng.normal(size=seen.shape)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    way = np.round(way, 5)  # as it is written: what the reader knows of it
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    along = np.sum(seen * way, axis=1)
    return _cells(("u_mm",), along) | _cells(("ux", "uy", "uz"), way, 1.0)


def _posts(seen: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return (4, 3) points around the work, and which of them each row uses (n,)."""
    middle, spread = seen.mean(axis=0), np.linalg.norm(np.std(seen, axis=0))
    away = rng.normal(size=(4, 3))
    away *= (2.0 * spread + 0.3) / np.linalg.norm(away, axis=1, keepdims=True)
    return np.round(middle + away, 5), rng.integers(0, 4, len(seen))


def _ballbar(seen: Array, rng: np.random.Generator) -> Cells:
    posts, at = _posts(seen, rng)
    length = np.linalg.norm(seen - posts[at], axis=1)
    return _cells(("length_mm",), length) | _cells(tuple(f"from_{n}" for n in XYZ), posts[at])


def _wire(seen: Array, rng: np.random.Generator) -> Cells:
    posts, at = _posts(seen, rng)
    length = np.linalg.norm(seen - posts[at], axis=1)
    return _cells(("length_mm",), length) | {"from_id": [f"post{k}" for k in at]}


def _mixed(seen: Array, rng: np.random.Generator) -> Cells:
    """Return each row in a form of its own, the columns of the others empty."""
    parts = [_xyz(seen), _camera(seen, rng), _dial(seen, rng), _ballbar(seen, rng)]
    which = rng.choice(4, len(seen), p=[0.4, 0.2, 0.2, 0.2])
    names = dict.fromkeys(name for part in parts for name in part)
    empty = [""] * len(seen)
    return {name: [parts[k].get(name, empty)[row] for row, k in enumerate(which)] for name in names}


_READ: dict[str, Callable[[Array, np.random.Generator], Cells]] = {
    "camera": _camera,
    "dial": _dial,
    "ballbar": _ballbar,
    "wire": _wire,
    "mixed": _mixed,
}


def touch(
    arm: Dimensions, rows: Rows, seen: Callable[[Rows], Array], rng: np.random.Generator
) -> tuple[Rows, Cells]:
    """Return rows driven on until the point touches one of three planes, and its name.

    Args:
        arm: nominal.
        rows: to start from.
        seen: points (n, 3) of rows, the error of the contact included [m].
        rng: of the planes.
    """
    start = seen(rows)
    normal = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    at = np.argmin(np.abs((start - start.mean(axis=0)) @ normal.T), axis=1)
    n, goal = normal[at], (normal @ start.mean(axis=0))[at]
    for _ in range(_STEPS):
        point = seen(rows)
        away = goal - np.sum(n * point, axis=1)
        J = columns(sweep(Geometry.of(arm, len(rows.q)), embed(rows.q)), point)
        g = np.einsum("ni,nij->nj", n, J)
        turn = g * (away / (np.sum(g**2, axis=1) + 1e-3))[:, None]
        rows = replace(rows, q=rows.q + np.clip(turn, -0.1, 0.1))
    return rows, {"plane": [f"face{k}" for k in at]}


_STEPS = 60
