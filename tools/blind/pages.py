"""Sentences of a diagnosis page against the numbers that stand beside them.

Each claim is a pattern of words and what must hold of the document of ``--json`` where the words
stand. It is written from the words alone: what a reader takes them to say.
"""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from typing import Any

Document = dict[str, Any]
SURE = 1e-3
"""Probability by chance below which a rest that follows a column is no noise."""
DOUBTFUL = 0.9
"""Probability below which a cause is open, and with it something ambiguous."""
TRIFLE = 1.0 / 3.0
"""Share of the noise below which a part that follows something is no gap."""
NOISE = 1.5
"""How many times its noise a rest may have and still look like it."""


def sentences(page: bytes) -> list[str]:
    """Return the sentences of a page or of a summary, tags taken out."""
    text = page.decode("utf-8")
    text = re.sub(r"(?s)<(script|style|svg)\b.*?</\1>", " ", text)
    text = re.sub(r"(?i)</(p|td|th|tr|h\d|li|div|section)>|<br>", "\n", text)
    text = html.unescape(re.sub(r"<[^>]+>", "", text))
    lines = (re.sub(r"\s+", " ", line).strip() for line in text.split("\n"))
    return [
        part for line in lines for part in re.split(r"(?<=[a-z%)][.:]) (?=[A-Z])", line) if part
    ]


def contradictions(content: Document, page: bytes) -> list[str]:
    """Return the sentences that the document contradicts, each with why."""
    found = []
    for sentence in sentences(page):
        for pattern, wrong in CLAIMS:
            told = re.search(pattern, sentence)
            why = wrong(content, told) if told else ""
            if why:
                found.append(f"{sentence[:120]!r}: {why}")
    return found


def _followed(content: Document, told: re.Match[str]) -> str:
    """A rest that is called noise follows nothing that was logged."""
    for test in content["residual"]["depends_on"]:
        if test["p_value"] < SURE:
            return f"it follows {test['name']} with p = {test['p_value']:g}"
    return ""


def _noise_size(content: Document, told: re.Match[str]) -> str:
    sigma, rest = content["noise"]["sigma_mm"], content["residual"]["rms_mm"]
    if sigma is None:
        return "nothing says how large the noise is"
    most = NOISE * 3.0**0.5 * sigma
    return f"{rest:g} mm are left of {most:g}" if rest > most else ""


def _no_gap(content: Document, told: re.Match[str]) -> str:
    named = f"{content['adopted']} are adopted" if content["adopted"] else ""
    return named or _noise_size(content, told) or _calm(content, told)


def _explained(content: Document, told: re.Match[str]) -> str:
    """What is explained leaves nothing that surely follows a column and is no trifle."""
    if content["verdict"] != "explained":
        return f"the verdict is {content['verdict']}"
    return _noise_size(content, told) or _calm(content, told)


def _calm(content: Document, told: re.Match[str]) -> str:
    least = TRIFLE * 3.0**0.5 * (content["noise"]["sigma_mm"] or 0.0)
    tests = content["residual"]["depends_on"]
    for test in tests:
        # one of so many is small by chance
        if test["p_value"] * len(tests) < SURE and test.get("rms_mm", 0.0) > least:
            return f"{test['rms_mm']:g} mm follow {test['name']} with p = {test['p_value']:g}"
    return ""


def _ambiguous(content: Document, told: re.Match[str]) -> str:
    for item in content["effects"]:
        if item["adopted"] and item["confounded_with"]:
            return f"{item['name']} cannot be told from {item['confounded_with']}"
        if item["adopted"] and item["probability"] < DOUBTFUL:
            return f"{item['name']} has {item['probability']:g}"
        if not item["adopted"] and item["probability"] > 0.4:
            return f"{item['name']} has {item['probability']:g} and is not adopted"
    if content["verdict"] in ("unexplained", "undetermined"):
        return f"the verdict is {content['verdict']}"
    return ""


def _time(content: Document, told: re.Match[str]) -> str:
    late = [test for test in content["residual"]["depends_on"] if test["name"] == "time"]
    if any(test["p_value"] < SURE for test in late):
        return f"time has p = {late[0]['p_value']:g}"
    if any(part["class"] == "time" for part in content["unexplained"]):
        return "a part of the rest has the class time"
    return "a drift is told" if content["noise"]["drift"] else ""


def _no_cause(content: Document, told: re.Match[str]) -> str:
    return f"{content['adopted']} are adopted" if content["adopted"] else ""


def _equals(*path: str) -> Callable[[Document, re.Match[str]], str]:
    """Return the check that a number of the sentence is that of the document."""

    def check(content: Document, told: re.Match[str]) -> str:
        value: Any = content
        for key in path:
            value = value[key]
        number = told.group(1)
        digits = len(number.partition(".")[2])
        real = len(value) if isinstance(value, list) else value
        if real is None or abs(float(number) - real) > 0.51 * 10.0**-digits + 1e-9:
            return f"{'.'.join(path)} is {real}"
        return ""

    return check


def _equals_none(*path: str) -> Callable[[Document, re.Match[str]], str]:
    """Return the check that a list of the document is empty."""

    def check(content: Document, told: re.Match[str]) -> str:
        value: Any = content
        for key in path:
            value = value[key]
        return f"{'.'.join(path)} has {len(value)}" if value else ""

    return check


def _shrunk(content: Document, told: re.Match[str]) -> str:
    before, after, share, low, high = (float(told.group(k)) for k in range(1, 6))
    if not low - 1 <= share <= high + 1:
        return "the interval does not hold the value"
    if before > 0.05 and abs(100.0 * (1.0 - after / before) - share) > 1.5:
        return f"{before} to {after} is {100.0 * (1.0 - after / before):.0f} %"
    return ""


def _mostly(content: Document, told: re.Match[str]) -> str:
    low = content["shrinkage"]["ci"][0]
    return f"the interval begins at {low:g}" if low < 0.0 else ""


CLAIMS: tuple[tuple[str, Callable[[Document, re.Match[str]], str]], ...] = (
    (r"looks? like noise|cannot be told from noise", _followed),
    (r"looks? like noise|no larger than noise", _noise_size),
    (r"^Explained", _explained),
    (r"^No gap", _no_gap),
    (r"Nothing is ambiguous|nothing is ambiguous", _ambiguous),
    (r"[Nn]othing is seen to follow time", _time),
    (r"^No cause\.|No cause is named|Nothing is adopted", _no_cause),
    (r"misses the simulation by ([\d.]+) mm", _equals("gap", "rms_mm")),
    (r"95 % within ([\d.]+)", _equals("gap", "p95_mm")),
    (r"largest ([\d.]+)\);", _equals("gap", "max_mm")),
    (r"noise ([\d.]+) mm per axis", _equals("noise", "sigma_mm")),
    (r"^Explained: (?:what remains, |the )([\d.]+) mm", _equals("residual", "rms_mm")),
    (r"^Unexplained: ([\d.]+) mm remain", _equals("residual", "rms_mm")),
    (r"[Mm]easuring faults left out \((\d+)\)", _equals("outliers")),
    (r"^(\d+) rows were left out as measuring faults", _equals("outliers")),
    (r"^(\d+) of \d+ rows are used", _equals("certificate", "rows", "used")),
    (r"^\d+ of (\d+) rows are used", _equals("rows", "total")),
    (r"^Each of (\d+) rows", _equals("certificate", "rows", "used")),
    (r"No pose was read often enough", _equals_none("certificate", "iso9283", "poses")),
    (r"(?:Part|Most) of the ([\d.]+) mm gap", _equals("gap", "rms_mm")),
    (r"^Most of the", _mostly),
    (
        r"([\d.]+) mm become ([\d.]+) on rows .*?(-?\d+) %.*?interval (-?\d+)(?: %)? to (-?\d+)",
        _shrunk,
    ),
)
"""Words, and what the numbers must not say beside them."""
