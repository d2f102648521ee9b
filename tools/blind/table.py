"""The table of the benchmark, per design and kind of case."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

Record = dict[str, Any]
Mark = tuple[str, Callable[[Sequence[Record]], float | None], str]


def _share(name: str) -> Callable[[Sequence[Record]], float | None]:
    return lambda marks: _mean(m.get(name) for m in marks)


def _mean(values: Iterable[Any]) -> float | None:
    known = [float(value) for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _pooled(name: str, kinds: tuple[str, ...]) -> Callable[[Sequence[Record]], float | None]:
    def pooled(marks: Sequence[Record]) -> float | None:
        return _mean(one for m in marks if m["kind"] in kinds for one in m.get(name) or [])

    return pooled


def _precision(wrong: str) -> Callable[[Sequence[Record]], float | None]:
    def precision(marks: Sequence[Record]) -> float | None:
        some = [m for m in marks if m["kind"] in ("one", "two", "three") and "right" in m]
        right = sum(len(m["right"]) for m in some)
        false = sum(len(m[wrong]) for m in some)
        return right / (right + false) if right + false else None

    return precision


def _quantile(name: str, q: float) -> Callable[[Sequence[Record]], float | None]:
    def quantile(marks: Sequence[Record]) -> float | None:
        known = [float(m[name]) for m in marks if m.get(name) is not None]
        return float(np.quantile(known, q)) if known else None

    return quantile


def _near(marks: Sequence[Record]) -> float | None:
    errors = [m["shrink_error"] for m in marks if m.get("shrink_error") is not None]
    return _mean(abs(error) <= 0.05 for error in errors)


def _single(name: str) -> Callable[[Sequence[Record]], float | None]:
    return lambda marks: _mean(m.get(name) for m in marks if m["kind"] == "one")


def _called(low: float, high: float) -> Callable[[Sequence[Record]], float | None]:
    """Share of right ones among the causes that were called with a probability."""

    def share(marks: Sequence[Record]) -> float | None:
        called = [one for m in marks for one in m.get("called") or []]
        return _mean(right for probability, right in called if low <= probability <= high)

    return share


def _parameter_error(marks: Sequence[Record]) -> float | None:
    errors = [one for m in marks for one in m.get("parameter_errors") or []]
    return float(np.median(errors)) if errors else None


MARKS: tuple[Mark, ...] = (
    ("top-1, one effect", _single("top1"), "0.95"),
    ("top-1", _share("top1"), ""),
    ("top-2", _share("top2"), ""),
    ("largest in the named set", _share("main_in_set"), "0.98"),
    ("recall, one effect", _pooled("recall", ("one",)), ""),
    ("recall, two and three", _pooled("recall", ("two", "three")), "0.90"),
    ("recall in set, two and three", _pooled("recall_set", ("two", "three")), ""),
    ("precision", _precision("wrong"), "0.97"),
    ("precision, sets allowed", _precision("wrong_outright"), ""),
    ("wrong cause with more than 0.5", _share("likely_wrong"), "0.03"),
    ("causes called 0.95 to 1 that are right", _called(0.95, 1.0), "0.95"),
    ("causes called 0.5 to 0.95 that are right", _called(0.5, 0.95), ""),
    ("outside: calm all the same", _share("false_calm"), "0"),
    ("outside: class right where abstained", _share("class_right"), "0.80"),
    ("no gap: false cause", _share("false_cause"), "0.01"),
    ("library: unexplained said", _share("false_unexplained"), "low"),
    ("outside: no wrong name", _share("abstained"), "0.95"),
    ("outside: unexplained or own name", _share("said_unexplained"), "0.95"),
    ("shrinkage within 5 points (fresh)", _near, "0.90"),
    ("shrinkage interval covers (fresh)", _share("shrink_covered"), "0.85-0.95"),
    ("worse than before: fresh", _share("worse_fresh"), "0"),
    ("worse than before: other design", _share("worse_transfer"), "0"),
    ("fresh residual / noise, median", _quantile("fresh_over_noise", 0.5), "1.2"),
    ("fresh residual / noise, 90 %", _quantile("fresh_over_noise", 0.9), ""),
    ("told noise / noise, median", _quantile("noise_ratio", 0.5), "1"),
    ("parameter error, median", _parameter_error, ""),
    (
        "parameter interval covers",
        _pooled("parameter_covered", ("one", "two", "three")),
        "0.85-0.95",
    ),
    ("worst joint found", _share("joint_found"), ""),
    ("run time, median [s]", _quantile("seconds", 0.5), "10"),
    ("run time, longest [s]", _quantile("seconds", 1.0), ""),
)


def summarise(answers: list[Record], marks: list[Record]) -> dict[str, dict[str, float | None]]:
    """Return every mark, for all cases and for each design class (fit for JSON)."""
    groups: dict[str, list[Record]] = {"all": marks}
    for answer, mark in zip(answers, marks, strict=True):
        loads = "no loads" if answer["loads"] == "none" else "loads"
        groups.setdefault(f"{answer['design'].split('_')[0]}, {loads}", []).append(mark)
        groups.setdefault("registered" if answer["registered"] else "own frame", []).append(mark)
    ordered = ["all", *sorted(name for name in groups if name != "all")]
    return {
        name: {"cases": len(groups[name])} | {title: of(groups[name]) for title, of, _ in MARKS}
        for name in ordered
    }


def markdown(summary: dict[str, dict[str, float | None]], title: str) -> str:
    """Return the table as markdown, one column a design class."""
    lines = [f"# {title}", "", "| mark | goal | " + " | ".join(summary) + " |"]
    lines.append("|---|---|" + "--:|" * len(summary))
    counts = " | ".join(f"{group['cases']:g}" for group in summary.values())
    lines.append(f"| cases | | {counts} |")
    for name, _, goal in MARKS:
        cells = " | ".join(_text(group[name]) for group in summary.values())
        lines.append(f"| {name} | {goal} | {cells} |")
    return "\n".join(lines) + "\n"


BINS = (0.0, 0.5, 0.8, 0.95, 1.0)
"""Edges of the probabilities that are compared with how often they are right."""
_Z90 = 1.6449


def reliability(marks: Sequence[Record]) -> str:
    """Return how often causes called with a probability are right, as markdown.

    The interval is that of Wilson (1927), 90 %.
    """
    called = [one for m in marks for one in m.get("called") or []]
    lines = ["| called with | causes | mean | right | 90 % interval |", "|---|--:|--:|--:|---|"]
    for low, high in pairwise(BINS):
        inside = [(p, right) for p, right in called if low < p <= high]
        if not inside:
            continue
        n, said, right = len(inside), *(float(v) for v in np.mean(inside, axis=0))
        centre = (right + _Z90**2 / (2 * n)) / (1 + _Z90**2 / n)
        half = _Z90 * np.sqrt(right * (1 - right) / n + _Z90**2 / (4 * n**2)) / (1 + _Z90**2 / n)
        ends = f"{centre - half:.2f} to {centre + half:.2f}"
        lines.append(f"| {low:g} to {high:g} | {n} | {said:.2f} | {right:.2f} | {ends} |")
    return "\n".join(lines) + "\n"


def faults(marks: list[Record]) -> Counter[str]:
    """Return how often each class of failure occurs."""
    return Counter(
        fault for m in marks for fault in set(m.get("faults") or ["crashed"] * m["crashed"])
    )


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
