"""The program text beside the plan: for every move its line, and where the text itself goes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from postproc.geometry import inverse
from postproc.report.parts.texts import unix_text

if TYPE_CHECKING:
    from postproc.arrays import FloatArray, IntArray
    from postproc.cell import Cell


@dataclass(frozen=True, slots=True)
class ProgramText:
    """Motions of a program in the order in which they are run.

    Args:
        files: names of the files in which motions stand.
        texts: whole text per file, plain line ends.
        file: (m,) row of ``files``; line: (m,) 1-based line.
        point: (m, 3) TCP at the end of each motion as the text says it, workpiece frame [m].
    """

    files: tuple[str, ...]
    texts: tuple[str, ...]
    file: IntArray
    line: IntArray
    point: FloatArray

    def __len__(self) -> int:
        """Return the number of motions."""
        return len(self.line)


def program_text(files: Mapping[str, bytes], name: str, cell: Cell) -> ProgramText:
    """Read program files back, run them and return the line and the target of every motion.

    Args:
        files: bytes by file name, as written.
        name: of the module to start.
        cell: what the program finds on the controller.

    Raises:
        KrlError: if a file is no KRL.
    """
    from postproc.kinematics import build
    from postproc.krl import parse_files
    from postproc.paths import run_in_cell

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
