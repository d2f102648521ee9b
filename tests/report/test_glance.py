"""What a diagnosis says at a glance, on documents made up by hand."""

from __future__ import annotations

from typing import Any

import pytest

from postproc.report.parts import doubt, how_far, where_joint, where_place, where_time, which


def document(**changes: Any) -> dict[str, Any]:
    """Return a document of one cause, with some entries changed."""
    cause = {
        **{"name": "backlash", "adopted": True, "probability": 0.97, "confounded_with": []},
        "rival": None,
        **{"rms_before_mm": 0.31, "rms_after_mm": 0.04, "shrinkage_ci": [0.84, 0.9]},
        **{"transfer": []},
    }
    content: dict[str, Any] = {
        "verdict": "explained",
        "adopted": ["backlash"],
        "serving": [],
        "effects": [cause, cause | {"name": "servo_lag", "adopted": False}],
        "gap": {"rms_mm": 0.31},
        "where": {
            "joints": [{"joint": 1, "share": 0.2}, {"joint": 2, "share": 0.71}],
            "cells": [{"min_mm": [0, 0, 0], "max_mm": [100, 200, 300], "rms_mm": 0.52}],
        },
        "shrinkage": {
            **{"rms_before_mm": 0.31, "rms_after_mm": 0.04},
            **{"value": 0.87, "ci": [0.84, 0.9]},
        },
        "noise": {"sigma_mm": 0.015, "conflict": None, "drift": None},
        "residual": {"structured_rms_mm": 0.08, "depends_on": []},
        "unexplained": [],
        "outliers": [],
        "not_testable": [],
    }
    return content | changes


def test_where_which_and_how_far() -> None:
    content = document()
    assert where_joint(content) == "71 % of what is explained enters at A2."
    assert "(50, 100, 150) mm: 0.520" in where_place(content)
    assert where_time(content) == "Nothing is seen to follow time."
    assert which(content) == [("backlash", "97 %", "0.270 mm")]
    assert how_far(content) == [
        "0.310 mm become 0.040 on rows that no fit has seen: 87 % less"
        " (90 % interval 84 % to 90 %)."
    ]


def test_classes_stand_beside_causes_and_in_time() -> None:
    late = {"class": "time", "of": "time", "shape": "step", "rms_mm": 0.1}
    content = document(adopted=[], effects=[], unexplained=[late])
    assert which(content) == [("no known cause, follows time: time (step)", "class", "0.100 mm")]
    assert "0.100 mm of the rest follow time: step" in where_time(content)
    assert where_joint(content) == "No cause is named, so no joint is."
    assert how_far(content) == ["Nothing is adopted: the model stays as it is."]


def test_a_promise_is_held_against_what_came_of_it() -> None:
    promise = {
        **{"rms_before_mm": 0.3, "rms_after_mm": 0.1, "shrinkage": 0.66, "promised": 0.9},
        **{"kept": False},
    }
    told = how_far(document(before=promise))[1]
    assert "0.300 mm became 0.100, 66 % less; 90 % were promised: less than promised." in told


def cause(**changes: Any) -> list[dict[str, Any]]:
    return [document()["effects"][0] | changes]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"noise": {"sigma_mm": None, "conflict": None, "drift": None}}, "nobody knows"),
        ({"noise": {"sigma_mm": 0.1, "conflict": "X is odd", "drift": None}}, "X is odd"),
        ({"verdict": "unexplained"}, "0.080 mm are left that are not noise"),
        ({"effects": cause(confounded_with=["joint_offset"])}, "may as well be joint_offset"),
        ({"effects": cause(rival="time (q3: step)")}, "another cause: time (q3: step) explains"),
        (
            {"effects": cause(transfer=[{"design": "B", "gain_nats": -4.0}])},
            "makes rows of B worse",
        ),
        ({"effects": cause(probability=0.6)}, "backlash is the least sure: 60 %"),
        ({"shrinkage": document()["shrinkage"] | {"value": 0.3}}, "only 30 % of the gap"),
        ({"outliers": ["a", "b"]}, "2 rows were left out"),
        ({"not_testable": [{"name": "servo_lag", "needs": ["qd"]}]}, "qd was not logged"),
        ({}, "84 % to 90 %"),
        ({"effects": [], "adopted": []}, "a wrong frame"),
    ],
)
def test_one_doubt_the_gravest_first(changes: dict[str, Any], words: str) -> None:
    assert words in doubt(document(**changes))
