"""Prints who notices the mutants of a program, or of every golden program below a folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from tools.mutants import Case, Judgement, cases_of, judge

HEAD = ("program", "mutants", "verify", "lint, reader", "harmless", "missed")


def main() -> None:
    """Judge the mutants of one program, or of many."""
    parser = argparse.ArgumentParser(description="Mutants of emitted programs.")
    parser.add_argument("program", type=Path, help="a program, or a folder of golden programs")
    parser.add_argument("--cell", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--model", type=Path)
    parser.add_argument("--each", type=int, help="so many of each rule in a file; all without it")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="of a folder only the program of this name")
    options = parser.parse_args()
    if options.program.is_dir():
        cases = [case for case in cases_of(options.program) if options.only in (None, case.name)]
    else:
        given = (options.cell, options.against, options.model)
        cases = [Case.of(options.program.stem, options.program, *given)]
    print(f"| {' | '.join(HEAD)} |\n| --- |{' --: |' * (len(HEAD) - 1)}")
    total = Judgement()
    for case in cases:
        found = judge(case, options.each, options.seed)
        print(_row(case.name, found), flush=True)
        for mutant in found.missed:
            print(f"  MISSED {mutant.rule}: {mutant.file}:{mutant.line}: {mutant.after[:100]}")
        total.add(found)
    print(_row("all", total))
    for name, counts in (("Noticed as", total.caught), ("Harmless", total.harmless)):
        parts = [f"{count} {what}" for what, count in counts.most_common()]
        print(f"\n{name}: {'; '.join(parts)}.")


def _row(name: str, found: Judgement) -> str:
    by_lint = sum(count for code, count in found.caught.items() if code.isupper())
    counts = (found.total, found.caught.total() - by_lint, by_lint, found.harmless.total())
    return f"| {name} | {' | '.join(map(str, (*counts, len(found.missed))))} |"


if __name__ == "__main__":
    main()
