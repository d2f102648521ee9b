"""Stiffness of the arm in the direction that the task needs."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Index
from postproc.errors import CellError, SourceRef
from postproc.planning.states.costs import StateContext, objective
from postproc.planning.states.place import cross_axes
from postproc.stiffness import index


def _along(context: StateContext, direction: FloatArray) -> FloatArray:
    if context.cell.optimize.index is Index.ELLIPSOID:
        return index.ellipsoid(context.jacobian, context.compliance, direction)
    return index.of_rates(context.rates(direction), context.compliance)


@objective("axial", is_stiffness=True)
def axial(context: StateContext) -> FloatArray:
    """Return the stiffness along the tool axis: flatness, countersink depth."""
    return _along(context, context.tool_axis)


@objective("normal", is_stiffness=True)
def normal(context: StateContext) -> FloatArray:
    """Return the stiffness across the path in the work plane: contour accuracy.

    The ellipsoid index is Eq. (43) of Jiao et al. 2022 with the spin as its angle, otherwise this
    is the true stiffness along the normal of the path.
    """
    if context.cell.optimize.index is not Index.ELLIPSOID:
        return _along(context, context.normal)
    first, second = cross_axes(np.asarray(context.cell.tool.axis))
    k_y = _along(context, context.R_robroot_tcp @ first)
    k_z = _along(context, context.R_robroot_tcp @ second)
    return index.ellipsoid_normal(k_y, k_z, context.spin)


@objective("radial", is_stiffness=True)
def radial(context: StateContext) -> FloatArray:
    """Return the stiffness of the weakest direction across the tool axis."""
    if context.cell.optimize.index is not Index.ELLIPSOID:
        return index.radial(context.jacobian, context.compliance, context.tool_axis)
    first, second = cross_axes(np.asarray(context.cell.tool.axis))
    k_y = _along(context, context.R_robroot_tcp @ first)
    k_z = _along(context, context.R_robroot_tcp @ second)
    return np.minimum(k_y, k_z)


@objective("process", is_stiffness=True)
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
