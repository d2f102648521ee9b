"""Prints who notices the mutants of a program."""

from __future__ import annotations

import argparse
from pathlib import Path

from postproc.cell import load_cell
from postproc.jobs.convert import ConvertRequest, read_toolpath
from tools.mutants import judge


def main() -> None:
    """Judge the mutants of one program."""
    parser = argparse.ArgumentParser(description="Mutants of an emitted program.")
    parser.add_argument("program", type=Path)
    parser.add_argument("--cell", required=True)
    parser.add_argument("--against")
    parser.add_argument("--every", type=int, default=1)
    options = parser.parse_args()
    folder = options.program.parent
    stem = options.program.stem.lower()
    beside = sorted(f for f in folder.iterdir() if f.suffix.lower() in (".src", ".dat"))
    own = [f for f in beside if f.stem.lower() == stem and f.suffix.lower() == ".src"]
    files = {f.name: f.read_bytes() for f in [*own, *(f for f in beside if f not in own)]}
    cell = load_cell(options.cell)
    request = ConvertRequest(str(options.against), options.cell)
    toolpath = read_toolpath(request, cell) if options.against else None
    result = judge(files, cell, toolpath, options.every)
    print(f"{result.total} mutants, {result.caught.total()} caught")
    for name, counts in (("caught by", result.caught), ("harmless:", result.harmless)):
        for what, count in counts.most_common():
            print(f"  {name} {what}: {count}")
    for mutant in result.missed:
        print(f"  MISSED {mutant.rule}: {mutant.file}:{mutant.line}: {mutant.after[:100]}")


if __name__ == "__main__":
    main()
