"""Blind answerers: diagnoses that never look at the data. They must score badly."""

from __future__ import annotations

from typing import Any

import numpy as np

from tools.blind.names import ALL

NAMES = ("random", "joint_compliance", "no_gap", "unexplained")
_VERDICTS = ("explained", "no_gap", "unexplained")


def blind_record(answer: dict[str, Any], name: str, seed: int) -> dict[str, Any]:
    """Return a record as of a run: a diagnosis made without the data."""
    rng = np.random.default_rng([seed, 9, int(answer["case"])])
    verdict, adopted = name, list[str]()
    if name == "random":
        verdict = str(rng.choice(_VERDICTS))
        count = 0 if verdict == "no_gap" else int(rng.integers(1, 4))
        adopted = [str(one) for one in rng.choice(ALL, count, replace=False)]
    if name == "joint_compliance":
        verdict, adopted = "explained", [name]
    effects = [{"name": one, "adopted": True, "confounded_with": []} for one in adopted]
    return {
        "case": answer["case"],
        "seconds": 0.0,
        "exit": 0,
        "diagnosis": {"verdict": verdict, "adopted": adopted, "effects": effects},
    }
