"""The page of examples: every case of ``fixtures`` with its files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

SHOWN = (
    ".apt",
    ".aptsource",
    ".clsf",
    ".cls",
    ".csv",
    ".dat",
    ".src",
    ".toml",
    ".txt",
    ".xml",
    ".1",
)
"""Files that a browser shows as text; meshes and pages are left in the repository."""


def pages(fixtures: Path) -> dict[str, str | bytes]:
    """Return the page of examples and the files that it links to."""
    result: dict[str, str | bytes] = {}
    lines = list(_head())
    for commands in sorted(fixtures.glob("*/commands.txt")):
        case = commands.parent
        files = [path for path in sorted(case.rglob("*")) if path.suffix in SHOWN]
        lines += _case(case, files)
        for path in files:
            result[f"examples/{path.relative_to(fixtures).as_posix()}"] = path.read_bytes()
    result["examples.md"] = "\n".join(lines) + "\n"
    return result


def _head() -> Iterator[str]:
    yield "# Examples\n"
    yield (
        "Each is a folder under `fixtures` with its input, its cell, the commands and the output "
        "that they make; the tests run the commands and compare every byte of a program. To try "
        "one, go into its folder, run the commands with another output folder than `expected`, and "
        "compare: `postproc diff expected out`."
    )


def _case(case: Path, files: list[Path]) -> Iterator[str]:
    text = (case / "commands.txt").read_text(encoding="utf-8").splitlines()
    yield f"\n## {case.name.replace('_', ' ')} {{ #{case.name} }}\n"
    yield " ".join(line.lstrip("# ") for line in text if line.startswith("#")) + "\n"
    yield "```text"
    yield from (line for line in text if not line.startswith("#"))
    yield "```\n"
    links = (f"[{path.relative_to(case).as_posix()}]({_url(case, path)})" for path in files)
    yield "Files: " + ", ".join(links)


def _url(case: Path, path: Path) -> str:
    return f"examples/{case.name}/{path.relative_to(case).as_posix()}"
