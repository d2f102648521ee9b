"""The findings of lint in real programs, by code, with what a programmer says of each."""

from __future__ import annotations

import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from postproc.errors import Finding, PostprocError, Severity
from postproc.jobs.lint import lint

_FILE = Path(__file__).resolve().parent / "judgements.toml"
_NOBODY = "nobody judged it yet"


@dataclass(slots=True)
class Table:
    """What lint found: by severity and code, and the errors that are no fault of the program."""

    files: int = 0
    findings: Counter[tuple[str, str]] = field(default_factory=Counter)
    places: dict[tuple[str, str], set[str]] = field(default_factory=lambda: defaultdict(set))
    false: list[Finding] = field(default_factory=list)
    errors: list[tuple[Finding, str]] = field(default_factory=list)

    @property
    def share(self) -> float:
        """Share of the files without a false error."""
        wrong = {finding.source.path for finding in self.false if finding.source}
        return 1.0 - len(wrong) / max(self.files, 1)


def table_of(folders: Iterable[Path]) -> Table:
    """Return the findings of lint in folders, each a backup or programs of one controller."""
    judgements = tomllib.loads(_FILE.read_text("utf-8"))["errors"]
    table = Table()
    for folder in folders:
        try:
            findings, files = lint([folder])
        except PostprocError as problem:
            print(f"{folder}: left out: {problem}")
            continue
        table.files += len(files)
        for finding in findings:
            _count(table, finding, judgements)
    return table


def _count(table: Table, finding: Finding, judgements: Sequence[dict[str, Any]]) -> None:
    path = finding.source.path if finding.source else ""
    key = (finding.severity.name.lower(), finding.code)
    table.findings[key] += 1
    table.places[key].add(path)
    if finding.severity is not Severity.ERROR:
        return
    judged = next((j for j in judgements if _is_meant(j, finding.code, path)), None)
    table.errors.append((finding, judged["why"] if judged else _NOBODY))
    if judged is None or not judged["is_true"]:
        table.false.append(finding)


def _is_meant(judgement: dict[str, Any], code: str, path: str) -> bool:
    return judgement["code"] == code and fnmatch(path, f"*/{judgement['file']}")


def lines_of(table: Table) -> Iterator[str]:
    """Yield the table as Markdown."""
    warnings = tomllib.loads(_FILE.read_text("utf-8"))["warnings"]
    yield "| code | severity | findings | files | judgement |"
    yield "| --- | --- | --: | --: | --- |"
    for (severity, code), count in sorted(table.findings.items(), key=lambda item: item[0][::-1]):
        words = warnings.get(code, _NOBODY)
        if severity == "error":
            reasons = dict.fromkeys(why for item, why in table.errors if item.code == code)
            words = "; ".join(reasons)
        places = len(table.places[severity, code])
        yield f"| {code} | {severity} | {count} | {places} | {words} |"
    yield ""
    yield (
        f"{table.files} files, {len(table.errors)} errors, {len(table.false)} of them false: "
        f"{100.0 * table.share:.1f} % of the files have no false error"
    )
    for finding in table.false:
        yield f"false or not judged: {finding}"
