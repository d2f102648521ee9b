"""For CI: is the released program what we would write today, and is it still good?

usage: python check_released.py PART CELL.toml RELEASED.src
"""

import sys
import tempfile
from pathlib import Path

import postproc as pp


def main(part: str, cell_file: str, released: str) -> int:
    """Return 0 when nothing changed and the released program verifies."""
    cell = pp.load_cell(cell_file)
    toolpath = pp.read(part, cell)
    with tempfile.TemporaryDirectory() as folder:
        job = pp.convert(toolpath, cell, name=Path(released).stem)
        job.write(folder)
        changes = pp.diff(released, Path(folder) / f"{job.name}.src")
    report = pp.verify(released, cell, against=toolpath)
    for item in (*changes.differences, *report.violations):
        print(item)
    return 0 if job.good and changes.same and report.ok else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
