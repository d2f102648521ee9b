"""Where the files of a robot stand in a backup: by the tail of their path, decoys left aside."""

from __future__ import annotations

from pathlib import PurePosixPath

from postproc.backup.archive import Archive
from postproc.errors import ReadError, SourceRef
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Layout:
    """Paths in the archive; empty for what is not there. ``root``: the folder R1."""

    machine: str
    config: str
    robcor: str
    info: str
    root: str


def find_files(archive: Archive, path: str) -> Layout:
    """Return where the robot's files are.

    Raises:
        ReadError: BAK006 if there is no robot, or more than one.
    """
    found = archive.names("R1", "Mada", "$machine.dat") or _of_bare_folder(archive)
    if len(found) != 1:
        raise ReadError("BAK006", *_wrong_count(archive, found, path))
    root = PurePosixPath(found[0]).parents[1]
    return Layout(
        machine=found[0],
        config=_inside(archive, root, "System", "$config.dat"),
        robcor=_inside(archive, root, "Mada", "$robcor.dat"),
        info=next(iter(sorted(archive.names("am.ini"), key=len)), ""),
        root=root.as_posix(),
    )


def _of_bare_folder(archive: Archive) -> list[str]:
    """Return machine data of an R1 whose folder has another name, those of STEU left aside."""
    return [
        name
        for name in archive.names("Mada", "$machine.dat")
        if "steu" not in [part.lower() for part in PurePosixPath(name).parts]
    ]


def _inside(archive: Archive, root: PurePosixPath, *tail: str) -> str:
    wanted = str(root.joinpath(*tail)).lower()
    return next((name for name in archive.names(*tail) if name.lower() == wanted), "")


def _wrong_count(archive: Archive, found: list[str], path: str) -> tuple[str, SourceRef, str]:
    source = SourceRef(path)
    if found:
        text = f"{len(found)} robots in it, expected one: {', '.join(sorted(found)[:5])}"
        return text, source, "give the folder of one of them"
    inner = [name for name in archive.sizes if name.lower().endswith(".zip")]
    hint = f"it holds the archive {inner[0]}: give that one" if inner else ""
    text = "no R1/Mada/$machine.dat in it, expected the backup of a KRC controller"
    return text, source, hint or "an archive of the controller, a KrcDiag, or the folder R1"
