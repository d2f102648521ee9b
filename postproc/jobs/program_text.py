"""The program text beside its plan: for every motion its line, and where the text itself goes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from postproc.cell import Cell
from postproc.geometry import inverse
from postproc.kinematics import build
from postproc.krl import parse_files
from postproc.paths import run_in_cell
from postproc.report.parts import ProgramText, unix_text


def program_text(files: Mapping[str, bytes], name: str, cell: Cell) -> ProgramText:
    """Read program files back, run them and return the line and the target of every motion.

    Args:
        files: bytes by file name, as written.
        name: of the module to start.
        cell: what the program finds on the controller.

    Raises:
        KrlError: if a file is no KRL.
    """
    kinematics = build(cell.robot)
    modules = parse_files(files)
    trace = run_in_cell(modules, name, cell, kinematics)
    point = np.array(trace.target[:, :3])
    axes = np.asarray(trace.is_axes)
    tools = trace.tools[trace.column("tool").astype(np.int64)]
    if axes.any():
        T_robroot_tcp = kinematics.fk(trace.target[axes]) @ tools[axes]
        point[axes] = (inverse(cell.T_robroot_base) @ T_robroot_tcp)[:, :3, 3]
    return ProgramText(
        files=trace.files,
        texts=tuple(_text(files, file) for file in trace.files),
        file=np.asarray(trace.file),
        line=np.asarray(trace.line),
        point=point,
    )


def _text(files: Mapping[str, bytes], name: str) -> str:
    return unix_text(files[name]) if name in files else ""
