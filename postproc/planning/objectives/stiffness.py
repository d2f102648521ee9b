"""Stiffness of the arm in the direction that the task needs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.errors import CellError, SourceRef
from postproc.model.arrays import FloatArray
from postproc.planning.costs import REGISTRY, StateContext
from postproc.planning.place import cross_axes
from postproc.stiffness import index


class StiffnessObjective:
    """A stiffness index as an objective, larger is better."""

    is_stiffness = True

    def __init__(self, function: Callable[[StateContext], FloatArray]) -> None:
        self._function = function
        self.__doc__ = function.__doc__

    def __call__(self, context: StateContext) -> FloatArray:
        """Return k (N,) [N/m]."""
        return self._function(context)


def _register(name: str, function: Callable[[StateContext], FloatArray]) -> None:
    REGISTRY.register(name)(StiffnessObjective(function))


def _along(context: StateContext, direction: FloatArray) -> FloatArray:
    if context.cell.optimize.index == "seed":
        return index.seed_directional(context.jacobian, context.compliance, direction)
    return index.directional(context.jacobian, context.compliance, direction)


def axial(context: StateContext) -> FloatArray:
    """Return the stiffness along the tool axis: flatness, countersink depth (seed: kx)."""
    return _along(context, context.tool_axis)


def normal(context: StateContext) -> FloatArray:
    """Return the stiffness across the path in the work plane: contour accuracy (seed: kv).

    With ``index = "seed"`` this is the paper's Eq. (43) with the turn about the tool axis as its
    angle; otherwise the true stiffness along the normal of the path.
    """
    if context.cell.optimize.index != "seed":
        return _along(context, context.normal)
    first, second = cross_axes(np.asarray(context.cell.tool.axis))
    k_y = _along(context, context.R_robroot_tcp @ first)
    k_z = _along(context, context.R_robroot_tcp @ second)
    return index.seed_normal(k_y, k_z, context.spin)


def radial(context: StateContext) -> FloatArray:
    """Return the stiffness of the weakest direction across the tool axis."""
    if context.cell.optimize.index != "seed":
        return index.radial(context.jacobian, context.compliance, context.tool_axis)
    first, second = cross_axes(np.asarray(context.cell.tool.axis))
    k_y = _along(context, context.R_robroot_tcp @ first)
    k_z = _along(context, context.R_robroot_tcp @ second)
    return np.minimum(k_y, k_z)


def process(context: StateContext) -> FloatArray:
    """Return the stiffness along the force of ``[process]``."""
    force = np.asarray(context.cell.process.wrench_tcp)[:3]
    size = float(np.linalg.norm(force))
    if size == 0.0:
        raise CellError(
            "PLN203",
            'objective "process" needs a force: [process] force_N is zero',
            SourceRef(context.cell.path),
        )
    return _along(context, context.R_robroot_tcp @ (force / size))


for _name, _part in (
    ("axial", axial),
    ("normal", normal),
    ("radial", radial),
    ("process", process),
):
    _register(_name, _part)
