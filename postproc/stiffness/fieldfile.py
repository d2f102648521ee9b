"""Joint stiffness in tables of ``model.toml``: one number a joint, or a field.

A table of kind ``grid`` or ``joint_space`` holds the whole stiffness over the workspace (not a
change on top of a constant). Which effects have such tables is theirs to say. NaN marks a joint
that the data could not see.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.errors import DataError
from postproc.model import ModelFile, entry
from postproc.stiffness.field import ContinuousField, Grid, GridField, Locate, StiffnessField
from postproc.units import DEG, MM

STIFFNESS = "stiffness_Nmm_per_rad"
CONSTANT_KEYS = (STIFFNESS, "unobservable_joints")
GRID_KEYS = (
    *("kind", "between_cells", "origin_mm", "cell_mm", "counts"),
    *(STIFFNESS, "unobservable_joints"),
)
JOINT_SPACE_KEYS = (
    *("kind", STIFFNESS, "length_deg", "nodes_deg", "log_compliance_weights"),
    *("own_length_deg", "own_nodes_deg", "own_log_compliance_weights"),
    "unobservable_joints",
)


def constant_table(c_joint: FloatArray) -> dict[str, Any]:
    """Return the table of constant compliances (6,) [rad/(N*m)], NaN where unseen."""
    with np.errstate(divide="ignore"):
        table = {STIFFNESS: entry(STIFFNESS, 1.0 / c_joint)}
    return table | _marks(np.isfinite(c_joint))


def field_table(field: StiffnessField) -> dict[str, Any] | None:
    """Return the table of a field over the workspace, None for a constant one."""
    if not isinstance(field, (GridField, ContinuousField)):
        return None
    if isinstance(field, GridField):
        table: dict[str, Any] = {
            "kind": "grid",
            "between_cells": "blend" if field.blend else "average",
            "origin_mm": entry("origin_mm", field.grid.origin),
            "cell_mm": entry("cell_mm", field.grid.size),
            "counts": list(field.grid.counts),
            STIFFNESS: entry(STIFFNESS, 1.0 / field.c_joint),
        }
    else:
        table = {
            "kind": "joint_space",
            STIFFNESS: entry(STIFFNESS, np.exp(-field.base)),
            "length_deg": entry("length_deg", field.lengths),
            "nodes_deg": entry("nodes_deg", field.nodes),
            "log_compliance_weights": field.weights.tolist(),
        }
        if len(field.own_nodes):
            table |= {
                "own_length_deg": entry("own_length_deg", field.own_lengths),
                "own_nodes_deg": entry("own_nodes_deg", field.own_nodes),
                "own_log_compliance_weights": field.own_weights.tolist(),
            }
    return table | _marks(field.observed)


def is_field_table(table: Mapping[str, Any]) -> bool:
    """Return whether a table holds a whole field, of a kind known here."""
    return table.get("kind") in ("grid", "joint_space")


def whole_field(model: ModelFile, effect: str, locate: Locate | None = None) -> StiffnessField:
    """Return the field of a table of kind ``grid`` or ``joint_space``.

    Args:
        model: with the table.
        effect: whose table it is.
        locate: joint angles to tool points, for a field over space.

    Raises:
        DataError: MOD004 to MOD006 for a wrong table, with the line.
    """
    if model.effects[effect]["kind"] == "grid":
        return _grid(model, effect, locate)
    return _joint_space(model, effect)


def constant_of(model: ModelFile, effect: str) -> FloatArray:
    """Return the compliances (6,) [rad/(N*m)] of a constant table, NaN where unseen.

    Raises:
        DataError: MOD004 to MOD006 for a wrong table, with the line.
    """
    model.require_known(effect, CONSTANT_KEYS)
    return _compliance(model, effect, (6,))


def _grid(model: ModelFile, name: str, locate: Locate | None) -> StiffnessField:
    model.require_known(name, GRID_KEYS)
    origin = _needed(model, name, "origin_mm", (3,))
    size = _needed(model, name, "cell_mm", (3,))
    counts = _needed(model, name, "counts", (3,))
    rule = model.effects[name].get("between_cells", "blend")
    if rule not in ("blend", "average"):
        raise DataError(
            "MOD006",
            f"between_cells is {rule!r}, expected 'blend' or 'average'",
            model.source(name, "between_cells"),
        )
    whole = bool(np.all(counts == np.rint(counts)))
    if not whole or bool(np.any(counts < 1)) or not bool(np.all(size > 0.0)):
        raise DataError(
            "MOD006", "counts and cell_mm must be positive", model.source(name, "counts")
        )
    grid = Grid(origin, size, (int(counts[0]), int(counts[1]), int(counts[2])))
    c = _compliance(model, name, (len(grid), 6))
    return GridField(grid, c, rule == "blend", locate)


def _joint_space(model: ModelFile, name: str) -> StiffnessField:
    model.require_known(name, JOINT_SPACE_KEYS)
    nodes = _needed(model, name, "nodes_deg", (None, 6))
    weights = _needed(model, name, "log_compliance_weights", (len(nodes), 6))
    lengths = _needed(model, name, "length_deg", (6,))
    if not bool(np.all(lengths > 0.0)):
        raise DataError("MOD006", "length_deg must be positive", model.source(name, "length_deg"))
    base = np.log(_compliance(model, name, (6,)))
    if "own_nodes_deg" not in model.effects[name]:
        return ContinuousField(nodes, lengths, base, weights)
    own_nodes = _needed(model, name, "own_nodes_deg", (None, 6))
    own_weights = _needed(model, name, "own_log_compliance_weights", (len(own_nodes), 6))
    own_lengths = _needed(model, name, "own_length_deg", (6,))
    if not bool(np.all(own_lengths > 0.0)):
        at = model.source(name, "own_length_deg")
        raise DataError("MOD006", "own_length_deg must be positive", at)
    return ContinuousField(nodes, lengths, base, weights, own_nodes, own_lengths, own_weights)


def _needed(model: ModelFile, effect: str, key: str, shape: tuple[int | None, ...]) -> FloatArray:
    values = model.values(effect, key, shape)
    if values is None or not bool(np.all(np.isfinite(values))):
        raise DataError("MOD006", f"{key} must be finite numbers", model.source(effect, key))
    return values


def _compliance(model: ModelFile, effect: str, shape: tuple[int, ...]) -> FloatArray:
    k = model.values(effect, STIFFNESS, shape)
    if k is None or bool(np.any(k <= 0.0)):
        raise DataError(
            "MOD006", f"{effect}.{STIFFNESS} must be positive", model.source(effect, STIFFNESS)
        )
    return np.asarray(1.0 / k)


def _marks(observed: BoolArray) -> dict[str, Any]:
    unseen = [int(i) + 1 for i in np.flatnonzero(~observed)]
    return {"unobservable_joints": unseen} if unseen else {}


def describe(field: StiffnessField) -> str:
    """Return what a field is, in words."""
    if isinstance(field, GridField):
        nx, ny, nz = field.grid.counts
        edge = "x".join(f"{v / MM:g}" for v in field.grid.size)
        return f"{nx}x{ny}x{nz} cells of {edge} mm"
    if isinstance(field, ContinuousField):
        shortest = float(field.lengths.min()) / DEG
        return f"continuous in joint space, {len(field.nodes)} nodes, from {shortest:.0f} deg"
    return "constant"
