"""The joint stiffness of a model file: which effect has it, for planning and for ``identify``."""

from __future__ import annotations

from postproc.arrays import FloatArray
from postproc.gap.effect import EFFECTS, Table
from postproc.model import ModelFile
from postproc.stiffness import Locate, StiffnessField


def stiffness_of(
    model: ModelFile, k_fallback: FloatArray | None = None, locate: Locate | None = None
) -> StiffnessField | None:
    """Return the joint stiffness of a model, None where it knows none.

    Where two effects give one, that counts which refines the other.

    Args:
        model: with tables of effects.
        k_fallback: (6,) [N*m/rad] for joints that the data could not see; None: rigid.
        locate: joint angles to tool points, for a field over space.

    Raises:
        DataError: MOD004 to MOD006 for wrong tables, with the line.
    """
    known = [effect for name, effect in EFFECTS if name in model.effects]
    for effect in sorted(known, key=lambda e: -len(e.refines)):
        field = effect.stiffness(model, locate)
        if field is not None:
            return field.with_fallback(k_fallback)
    return None


def stiffness_tables(field: StiffnessField, c_mean: FloatArray) -> dict[str, Table]:
    """Return the effects' tables that hold an identified stiffness.

    Args:
        field: the stiffness.
        c_mean: (6,) its constant part, NaN for a joint not seen [rad/(N*m)].
    """
    tables = {name: effect.stiffness_table(field, c_mean) for name, effect in EFFECTS}
    return {name: table for name, table in tables.items() if table is not None}
