"""Command line: ``python -m tools.blind generate``, ``score``, ``families``, and experiments."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from tools.blind import answerers, families, loop, promise, stiffness, table
from tools.blind.judging import judge
from tools.blind.running import run_all
from tools.blind.writing import generate

EXPERIMENTS = {"loop": loop, "promise": promise, "stiffness": stiffness}


def main(arguments: list[str] | None = None) -> int:
    """Run a command; return the exit code."""
    options = _parser().parse_args(arguments)
    if options.command == "generate":
        answers = generate(Path(options.output), options.cases, options.seed)
        print(f"{len(answers)} cases in {options.output}, seed {options.seed}", file=sys.stderr)
        return 0
    if options.command == "families":
        folder, names = Path(options.output), options.only or list(families.FAMILIES)
        text = families.run(folder, names, options.count, options.seed, options.jobs, options.again)
        (folder / "families.md").write_text(text, encoding="utf-8")
        print(text)
        return 0
    if options.command in EXPERIMENTS:
        print(run_experiment(options.command, Path(options.output), options.cases, options.seed))
        return 0
    text, _ = score(
        Path(options.directory), options.answerer, options.processes, options.again, options.first
    )
    print(text)
    return 0


def score(
    folder: Path, answerer: str, processes: int = 2, again: bool = False, first: int | None = None
) -> tuple[str, dict[str, Any]]:
    """Score a product, or a blind answerer, on generated cases.

    Args:
        folder: as written by ``generate``; gets ``score_NAME.json`` and ``score_NAME.md``.
        answerer: "product" or a name of ``answerers.NAMES``.
        processes: cases at a time.
        again: run anew.
        first: only so many cases.

    Returns:
        The table as markdown, and everything as in the JSON file.
    """
    sealed = json.loads((folder / "answers.json").read_text(encoding="utf-8"))
    answers = sealed["cases"][:first]
    if answerer == "product":
        records = run_all(folder, answers, processes, again)
    else:
        records = [answerers.blind_record(a, answerer, sealed["seed"]) for a in answers]
    marks = [judge(a, r) for a, r in zip(answers, records, strict=True)]
    summary = table.summarise(answers, marks)
    count = table.faults(marks)
    title = f"Withheld effects: {answerer}, {len(answers)} cases, seed {sealed['seed']}"
    text = table.markdown(summary, title)
    text += "\nHow often named causes are right:\n\n" + table.reliability(marks)
    text += "\nMost frequent failures:\n\n"
    text += "".join(f"- {number} x {name}\n" for name, number in count.most_common(20))
    whole = {"seed": sealed["seed"], "answerer": answerer, "summary": summary, "cases": marks}
    (folder / f"score_{answerer}.md").write_text(text, encoding="utf-8")
    (folder / f"score_{answerer}.json").write_text(json.dumps(whole, indent=1), encoding="utf-8")
    return text, whole


def run_experiment(name: str, folder: Path, count: int, seed: int) -> str:
    """Run the cases of an experiment.

    Args:
        name: one of ``EXPERIMENTS``.
        folder: gets a folder for each case, ``NAME.json`` and ``NAME.md``.
        count: how many cases.
        seed: of everything that is drawn.

    Returns:
        The table as markdown.
    """
    module = EXPERIMENTS[name]
    cases = []
    for number in range(1, count + 1):
        cases.append(module.run(number, seed, folder / f"{number:04d}"))
        print(f"case {number} of {count}", file=sys.stderr, flush=True)
    text = module.table(cases, f"{module.TITLE}: {count} cases, seed {seed}")
    (folder / f"{name}.md").write_text(text, encoding="utf-8")
    whole = {"schema": f"blind.{name}/1", "seed": seed, "cases": cases}
    (folder / f"{name}.json").write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
    return text


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tools.blind", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    make = commands.add_parser("generate", help="write cases and their sealed answers")
    make.add_argument("-o", "--output", required=True, metavar="DIR")
    make.add_argument("--cases", type=int, default=200)
    make.add_argument("--seed", type=int, default=1)
    for name, module in EXPERIMENTS.items():
        own = commands.add_parser(name, help=module.HELP)
        own.add_argument("-o", "--output", required=True, metavar="DIR")
        own.add_argument("--cases", type=int, default=12)
        own.add_argument("--seed", type=int, default=1)
    ways = commands.add_parser("families", help="draw families of campaigns, run and score them")
    ways.add_argument("-o", "--output", required=True, metavar="DIR")
    ways.add_argument("--count", type=int, default=12, help="cases of each family")
    ways.add_argument("--seed", type=int, default=1)
    ways.add_argument("--jobs", type=int, default=2, help="cases at a time")
    ways.add_argument("--only", nargs="+", choices=families.FAMILIES, metavar="FAMILY")
    ways.add_argument("--again", action="store_true", help="do not use earlier runs")
    judged = commands.add_parser("score", help="run the product on the cases and print the table")
    judged.add_argument("-d", "--directory", required=True, metavar="DIR")
    judged.add_argument("--answerer", choices=("product", *answerers.NAMES), default="product")
    judged.add_argument("--processes", type=int, default=2)
    judged.add_argument("--again", action="store_true", help="do not use earlier runs")
    judged.add_argument("--first", type=int, metavar="N", help="only the first N cases")
    return parser


if __name__ == "__main__":
    sys.exit(main())
