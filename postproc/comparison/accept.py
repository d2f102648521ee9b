"""Accept a new version: its files come over those of the old one, byte for byte."""

from __future__ import annotations

from pathlib import Path

from postproc.comparison.manifest import NAME as MANIFEST
from postproc.controller import load_program
from postproc.errors import KrlError, SourceRef
from postproc.files import read_bytes, write_files
from postproc.krl import KrlModule, load_modules


def accept(old: str | Path, new: str | Path) -> list[str]:
    """Copy a program with its sub-programs, or a folder's modules, over the old ones.

    Of folders, modules that the new one has no more are removed from the old one, and a batch's
    manifest comes along. All other files stay as they are.

    Returns:
        The files that were written or removed, in order; empty if all were the same.

    Raises:
        KrlError: DIF002 if the two programs have different names; or if one is no KRL.
        ReadError: if a file cannot be read or written.
    """
    left, right = Path(old), Path(new)
    if left.is_dir():
        before, after = _files(left, load_modules([left])), _files(right, load_modules([right]))
        gone = sorted(before.keys() - after.keys())
        if (right / MANIFEST).is_file():
            after[MANIFEST] = right / MANIFEST
    else:
        if left.stem.upper() != right.stem.upper():
            raise KrlError(
                "DIF002",
                f"{left.stem} cannot become {right.stem}: a module has the name of its file",
                SourceRef(str(new)),
            )
        before, after = {}, _files(right.parent, load_program(right))
        gone, left = [], left.parent
    contents = {}
    for name, path in sorted(after.items()):
        content = read_bytes(path)
        target = before.get(
            name, left / path.relative_to(right if right.is_dir() else right.parent)
        )
        if not target.is_file() or target.read_bytes() != content:
            contents[target] = content
    write_files(contents)
    for name in gone:
        before[name].unlink(missing_ok=True)
    return [str(path) for path in sorted([*contents, *(before[name] for name in gone)])]


def _files(folder: Path, modules: tuple[KrlModule, ...]) -> dict[str, Path]:
    """Return the files of modules by their upper-case name within the folder."""
    paths = [Path(p) for m in modules for p in (m.src_path, m.dat_path) if p]
    return {str(path.relative_to(folder)).upper(): path for path in paths if path.is_file()}
