"""Sentences against numbers: what a page may say of a document, and what not."""

from __future__ import annotations

from typing import Any

import pytest

from tools.blind.pages import contradictions, sentences


def document(**changes: Any) -> dict[str, Any]:
    cause = {
        **{"name": "backlash", "adopted": True, "probability": 0.97, "confounded_with": []},
        **{"rms_before_mm": 0.31, "rms_after_mm": 0.03},
    }
    content: dict[str, Any] = {
        **{"verdict": "explained", "adopted": ["backlash"], "effects": [cause], "outliers": []},
        "noise": {"sigma_mm": 0.02, "drift": None},
        "gap": {"rms_mm": 0.31, "p95_mm": 0.5, "max_mm": 0.8},
        "shrinkage": {"value": 0.9, "ci": [0.86, 0.93]},
        "residual": {"rms_mm": 0.034, "depends_on": [{"name": "time", "p_value": 0.4}]},
        "unexplained": [],
        "rows": {"total": 60},
        "certificate": {"rows": {"used": 58}, "iso9283": {"poses": [{"pose": "r1"}]}},
    }
    return content | changes


OPEN = {"name": "backlash", "adopted": True, "probability": 0.5, "confounded_with": []}
SET = OPEN | {"probability": 0.95, "confounded_with": ["servo_lag"]}
WARM = {"rms_mm": 0.034, "depends_on": [{"name": "temperature", "p_value": 0.0005}]}

LARGE = {
    "rms_mm": 0.034,
    "depends_on": [{"name": "temperature", "p_value": 1e-9, "rms_mm": 0.03}],
}


@pytest.mark.parametrize(
    ("sentence", "changes", "why"),
    [
        ("Explained: the 0.034 mm that remain look like noise.", {"residual": WARM}, "temperature"),
        ("Explained: what remains, 0.034 mm, looks like noise.", {"residual": WARM}, "temperature"),
        (
            "Explained: what remains, 0.034 mm, looks like noise.",
            {"noise": {"sigma_mm": 0.005, "drift": None}},
            "are left of",
        ),
        ("Explained: what remains, 0.035 mm, looks like noise.", {}, "residual.rms_mm is 0.034"),
        ("Nothing is ambiguous on these rows.", {"effects": [OPEN]}, "has 0.5"),
        ("Nothing is ambiguous on these rows.", {"effects": [SET]}, "cannot be told"),
        (
            "Nothing is seen to follow time.",
            {"residual": {"depends_on": [{"name": "time", "p_value": 1e-5}]}},
            "time has",
        ),
        (
            "Explained: what remains, 0.034 mm, is no larger than noise, but follows temperature.",
            {"residual": LARGE},
            "mm follow temperature",
        ),
        ("No cause.", {}, "are adopted"),
        ("No gap: what is measured, 0.310 mm, looks like noise.", {}, "are adopted"),
        ("The robot misses the simulation by 0.320 mm rms", {}, "gap.rms_mm is 0.31"),
        ("Measuring faults left out (2): r1, r2", {"outliers": ["r1"]}, "outliers is 1"),
        (
            "0.310 mm become 0.030 on rows that no fit has seen: 80 % less"
            " (90 % interval 70 % to 85 %).",
            {},
            "is 90 %",
        ),
        ("59 of 60 rows are used.", {}, "rows.used is 58"),
        ("58 of 61 rows are used.", {}, "rows.total is 60"),
        ("No pose was read often enough from one side", {}, "poses has 1"),
        ("Most of the 0.31 mm gap, 60 %,", {"shrinkage": {"ci": [-0.2, 0.9]}}, "begins at"),
    ],
)
def test_a_sentence_that_numbers_contradict_is_found(sentence, changes, why) -> None:
    page = f"<html><style>p {{}}</style><body><p>{sentence}</p></body></html>".encode()
    found = contradictions(document(**changes), page)
    assert len(found) >= 1
    assert any(why in one for one in found), found


def test_what_the_numbers_say_may_be_said() -> None:
    said = [
        "The robot misses the simulation by 0.310 mm rms (95 % within 0.500, largest 0.800);",
        "Explained: what remains, 0.034 mm, looks like noise.",
        "Nothing is ambiguous on these rows.",
        "Nothing is seen to follow time.",
        "0.310 mm become 0.031 on rows that no fit has seen: 90 % less"
        " (90 % interval 86 % to 93 %).",
    ]
    page = "".join(f"<p>{one}</p>" for one in said).encode()
    assert contradictions(document(), page) == []
    warm = "Explained: what remains, 0.034 mm, is no larger than noise, but follows temperature."
    assert contradictions(document(residual=WARM), f"<p>{warm}</p>".encode()) == []


def test_sentences_are_those_of_a_reader() -> None:
    page = b"<h2>One</h2><script>Explained</script><td>a &amp; b</td><p>No cause. Then more.</p>"
    assert sentences(page) == ["One", "a & b", "No cause.", "Then more."]
