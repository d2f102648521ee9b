"""The golden programs of ``fixtures``, as their ``commands.txt`` says how they are verified."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from postproc.cell import Cell, load_cell
from postproc.compensation import RealArm
from postproc.jobs.convert import ConvertRequest, read_toolpath
from postproc.model import ToolPath, load_model
from postproc.paths import Displacement


@dataclass(frozen=True, slots=True)
class Case:
    """A program and what it is judged by; the file that it starts in is the first one."""

    name: str
    files: Mapping[str, bytes]
    cell: Cell
    toolpath: ToolPath | None = None
    displacement: Displacement | None = None

    @classmethod
    def of(
        cls, name: str, program: Path, cell: Path, against: Path | None, model: Path | None
    ) -> Case:
        """Return the case of a program and what stands beside it in its folder."""
        every = sorted(f for f in program.parent.iterdir() if f.suffix.lower() in (".src", ".dat"))
        every.sort(key=lambda file: file.name != program.name)
        loaded = load_cell(str(cell))
        toolpath = displacement = None
        if against is not None:
            toolpath = read_toolpath(ConvertRequest(str(against), str(cell)), loaded)
        if model is not None:
            displacement = RealArm.of(loaded, load_model(str(model))).on_runs
        files = {file.name: file.read_bytes() for file in every}
        return cls(name, files, loaded, toolpath, displacement)


def cases_of(folder: Path) -> Iterator[Case]:
    """Yield the golden programs below a folder."""
    for listed in sorted(folder.rglob("commands.txt")):
        for line in listed.read_text("utf-8").splitlines():
            words = shlex.split(line, comments=True)
            if words[:2] == ["postproc", "verify"]:
                paths = {
                    key: listed.parent / words[words.index(key) + 1]
                    for key in ("--cell", "--against", "--model")
                    if key in words
                }
                yield Case.of(
                    listed.parent.name,
                    listed.parent / words[2],
                    paths["--cell"],
                    paths.get("--against"),
                    paths.get("--model"),
                )
