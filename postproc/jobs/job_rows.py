"""Where the arm is while a job is worked on, as rows of a model of the arm."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.compensation import loads
from postproc.errors import PlanError
from postproc.kinematics import build
from postproc.model import MoveRole, ToolPath
from postproc.planning import PlanOptions
from postproc.planning import plan as plan_toolpath
from postproc.process import operation_loads
from postproc.records import dataclass

_MOST = 400
"""Rows: more say no more about a job."""


@dataclass(frozen=True, slots=True)
class JobRows:
    """Where a job stands and cuts.

    q (n, 6) [rad]; side (n, 6) of the last motion; wrench (n, 6) of the process, robroot; point
    (n, 3) of the tool in the flange [m]; left_out: names of tags that cannot be driven to.
    """

    q: FloatArray
    side: FloatArray
    wrench: FloatArray
    point: FloatArray
    left_out: tuple[str, ...] = ()

    @classmethod
    def nothing(cls) -> JobRows:
        """Return those of no job."""
        none = np.zeros((0, 6))
        return cls(none, none, none, np.zeros((0, 3)))

    @classmethod
    def of(cls, part: ToolPath, cell: Cell) -> JobRows:
        """Return where the arm is last at each tag that it works on, as ``convert`` plans it."""
        plan = plan_toolpath(part, cell, PlanOptions(partial=True))
        tag, role = np.asarray(plan.tag), np.asarray(plan.role)
        works = np.flatnonzero((tag >= 0) & np.isin(role, (MoveRole.CUT, MoveRole.PLUNGE)))[::-1]
        # of each tag the last move: of a hole its bottom
        last = works[np.unique(tag[works], return_index=True)[1]]
        if not len(last):
            why = f": {plan.errors[0].message}" if plan.errors else ""
            raise PlanError("STF029", f"none of its tags can be driven to{why}", part.source(0))
        last = last[np.unique(np.linspace(0, len(last) - 1, _MOST).astype(int))]
        turned = np.sign(np.diff(plan.q, axis=0, prepend=plan.q[:1]))[last]
        q, kinematics = np.asarray(plan.q)[last], build(cell.robot)
        wrenches, row = operation_loads(plan.toolpath, cell)
        process = wrenches[row[tag[last]]]
        wrench, point = np.zeros((len(q), 6)), np.zeros((len(q), 3))
        tools = np.zeros(len(q), dtype=np.int32) if plan.tool is None else plan.tool[last]
        for tool in np.unique(tools).tolist():
            own, here = tools == tool, cell.with_tool(tool)
            working = np.ones(int(own.sum()), dtype=np.bool_)
            wrench[own] = loads(q[own], here, kinematics, working, False, process[own])
            point[own] = here.tool.T_flange_tcp[:3, 3]
        lost = sorted({f.tag_index for f in plan.errors if f.tag_index is not None})
        names = tuple(plan.toolpath.tag_name(tag) for tag in lost)
        return cls(q, turned, wrench, point, names)
