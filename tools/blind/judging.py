"""Marks for one case: what was named, what was missed, what the model does on new rows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tools.blind import names

Record = dict[str, Any]
THROWN = 0.2
"""Share of the genuine rows that may be taken for measuring faults."""
NEAR = 0.75
"""Two effects within this ratio of size are equally "the largest"."""


def judge(answer: Record, record: Record) -> Record:
    """Return the marks of a case; a mark that does not apply is None."""
    diagnosis = record.get("diagnosis")
    marks: Record = {"case": answer["case"], "kind": answer["kind"], "crashed": diagnosis is None}
    if diagnosis is None:
        return marks
    adopted = [str(name) for name in diagnosis["adopted"]]
    twins = _twins(diagnosis)
    right, neutral = names.hits(answer), names.tolerated(answer)
    wrong = [name for name in adopted if name not in right | neutral]
    marks |= {
        "verdict": diagnosis["verdict"],
        "classes": [part["class"] for part in diagnosis.get("unexplained", ())],
        "adopted": adopted,
        "right": [name for name in adopted if name in right],
        "wrong": wrong,
        "likely_wrong": any(
            e.get("probability", 0.0) > 0.5 and e["name"] in wrong for e in diagnosis["effects"]
        ),
        "called": [
            (float(e["probability"]), e["name"] not in wrong)
            for e in diagnosis["effects"]
            if e["adopted"] and "probability" in e
        ],
        "wrong_outright": [name for name in wrong if not twins.get(name, set()) & right],
        "seconds": record["seconds"],
        "contradictions": record.get("contradictions"),
        "noise_told": answer.get("noise_told"),
    }
    marks |= _naming(answer, adopted, twins)
    marks |= _verdict(answer, marks)
    marks |= _thrown(answer, diagnosis)
    marks |= _numbers(answer, record, diagnosis)
    marks["faults"] = _faults(answer, marks)
    return marks


def _twins(diagnosis: Record) -> dict[str, set[str]]:
    """Return, for every adopted effect, the names that it was said not to be told from."""
    return {
        effect["name"]: set(effect.get("confounded_with", []))
        for effect in diagnosis["effects"]
        if effect["adopted"]
    }


def _naming(answer: Record, adopted: list[str], twins: dict[str, set[str]]) -> Record:
    """Marks of the effects that a library can name."""
    true = names.rightful(answer)
    if not true or answer["kind"] in ("none", "outside"):
        return dict.fromkeys(("top1", "top2", "main_in_set", "recall", "recall_set"))
    named = set(adopted).union(*twins.values())
    biggest = [t for t in true if t["size_sigma"] >= NEAR * true[0]["size_sigma"]]
    goals = set().union(*(names.hit_by(answer, t["name"]) for t in biggest))
    beside = names.tolerated(answer).union(*(names.beside(t["name"]) for t in biggest)) - goals
    ranked = [name for name in adopted if name not in beside]
    planned = [t for t in true if t["role"] == "planned"]
    found = [bool(names.hit_by(answer, t["name"]) & set(adopted)) for t in planned]
    in_set = [bool(names.hit_by(answer, t["name"]) & named) for t in planned]
    return {
        "top1": bool(set(ranked[:1]) & goals),
        "top2": bool(set(ranked[:2]) & goals),
        "main_in_set": bool(named & goals),
        "recall": found,
        "recall_set": in_set,
        "missed": [t["name"] for t, one in zip(planned, in_set, strict=True) if not one],
        "only_in_set": [
            t["name"] for t, a, s in zip(planned, found, in_set, strict=True) if s and not a
        ],
    }


def _verdict(answer: Record, marks: Record) -> Record:
    """Marks of "no gap" and "unexplained"."""
    kind, said = answer["kind"], marks["verdict"]
    if kind == "mixed":
        own = set().union(*(set(names.own_names(t["name"])) for t in names.outside(answer)))
        calm = said in ("explained", "no_gap") and not own & set(marks["adopted"])
        return {"false_calm": calm}
    if kind == "none":
        clear = not any(t["weight"] == "true" for t in answer["truth"])
        return {"false_cause": bool(marks["wrong"]) if clear else None}
    if kind == "outside":
        own = set().union(*(set(names.own_names(t["name"])) for t in names.outside(answer)))
        own = own if not any(t["name"] in names.ALL for t in names.outside(answer)) else set()
        by_name = bool(own & set(marks["adopted"]))
        return {
            "abstained": not marks["wrong_outright"],
            "said_unexplained": said in ("unexplained", "undetermined") or by_name,
            "own_name": by_name,
            "false_calm": said in ("explained", "no_gap") and not by_name,
            "class_right": _class_right(answer, marks),
        }
    return {"false_unexplained": said == "unexplained"}


def _class_right(answer: Record, marks: Record) -> bool | None:
    """Return whether the largest part of the rest is of the hidden effect's class."""
    wanted, found = names.classes(answer), marks["classes"]
    if not wanted or marks["verdict"] not in ("unexplained", "undetermined"):
        return None
    return bool(found) and found[0] in wanted


def _thrown(answer: Record, diagnosis: Record) -> Record:
    """Mark whether rows that a real cause moves are called measuring faults."""
    genuine = set(answer.get("genuine") or ())
    if not genuine:
        return {}
    gone = genuine & set(map(str, diagnosis.get("outliers") or ()))
    return {"thrown": len(gone) > max(2, THROWN * len(genuine))}


def _numbers(answer: Record, record: Record, diagnosis: Record) -> Record:
    """Marks of shrinkage, residual, intervals, noise and place."""
    marks: Record = {"worse_fresh": None, "worse_transfer": None}
    hidden = {t["name"] for t in answer["truth"]}
    if not hidden & (names.STATION - names.INSTRUMENT):
        marks |= _on_new_rows(answer, record, diagnosis)
    if hidden & names.INSTRUMENT:
        marks |= dict.fromkeys(("shrink_error", "shrink_covered"))
    if diagnosis.get("noise_mm") is not None:
        marks["noise_ratio"] = diagnosis["noise_mm"] / answer["noise_mm"]
    return marks | _place(answer, diagnosis) | _parameters(answer, diagnosis)


def _on_new_rows(answer: Record, record: Record, diagnosis: Record) -> Record:
    """Marks of what the model does on poses that were not measured before."""
    marks: Record = {}
    fresh, transfer = _gain(record.get("fresh")), _gain(record.get("transfer"))
    told = diagnosis.get("shrinkage") or {}
    if fresh is not None and told.get("value") is not None and diagnosis["adopted"]:
        marks["shrink_error"] = float(told["value"]) - fresh
        if told.get("ci"):
            marks["shrink_covered"] = told["ci"][0] - 0.005 <= fresh <= told["ci"][1] + 0.005
    floor = np.sqrt(3) * answer["noise_mm"]
    if fresh is not None:
        marks["fresh_over_noise"] = record["fresh"]["after_mm"] / floor
    marks["worse_fresh"] = _worse(record.get("fresh"))
    marks["worse_transfer"] = _worse(record.get("transfer"))
    marks["transfer_shrink"] = transfer
    for name in ("fresh", "transfer"):
        pair = record.get(name) or {}
        if pair.get("inside"):
            marks[f"held_{name}"] = pair["held"] / pair["inside"]
    return marks


def _gain(pair: Record | None) -> float | None:
    if not pair or not pair["before_mm"] or pair["after_mm"] is None:
        return None
    return 1.0 - float(pair["after_mm"]) / float(pair["before_mm"])


def _worse(pair: Record | None) -> bool | None:
    gain = _gain(pair)
    return None if gain is None else gain < -0.02


def _place(answer: Record, diagnosis: Record) -> Record:
    joints = diagnosis.get("where", {}).get("joints") or []
    if not joints or answer["joint_share"] is None or answer["joints_explain"] < 0.8:
        return {}
    if not diagnosis["adopted"]:
        return {}
    told = max(joints, key=lambda one: float(one["share"]))["joint"]
    shares = np.array(answer["joint_share"])
    return {"joint_found": bool(shares[told - 1] >= 0.8 * shares.max())}


def _parameters(answer: Record, diagnosis: Record) -> Record:
    """Compare stiffness and half gaps, where nothing else that is hidden moves them."""
    effects = {one["name"]: one for one in diagnosis["effects"] if one["adopted"]}
    hidden = {t["name"]: t for t in answer["truth"] if t["weight"] == "true"}
    errors: list[float] = []
    covered: list[bool] = []
    if "joint_compliance" in effects and set(hidden) <= {"joint_compliance", "base_frame"}:
        real = np.array(answer["joint_Nmm_per_rad"])
        _compare(effects["joint_compliance"], "stiffness_Nmm_per_rad", real, errors, covered)
    if "backlash" in effects and "half" in hidden.get("backlash", {}).get("parameters", ()):
        t = hidden["backlash"]
        half = np.rad2deg(t["strength"] * np.array(t["parameters"]["half"]))
        _compare(effects["backlash"], "half_gap_deg", half, errors, covered, absolute=True)
    return {"parameter_errors": errors, "parameter_covered": covered}


def _compare(
    effect: Record,
    key: str,
    real: NDArray[np.float64],
    errors: list[float],
    covered: list[bool],
    *,
    absolute: bool = False,
) -> None:
    told = effect.get("parameters", {}).get(key)
    band = effect.get("interval_90") or {}
    low, high = (band.get(side, {}).get(key) for side in ("low", "high"))
    for k, value in enumerate(told or []):
        if value is None or not np.isfinite(value) or abs(real[k]) < 1e-9:
            continue
        sign = np.sign(value) if absolute else 1.0
        errors.append(abs(sign * float(value) / float(real[k]) - 1.0))
        if low and high and low[k] is not None and high[k] is not None:
            ends = sorted((sign * float(low[k]), sign * float(high[k])))
            covered.append(bool(ends[0] <= real[k] <= ends[1]))


def _faults(answer: Record, marks: Record) -> list[str]:
    """Return the classes of failure of a case, in words of the data."""
    hidden = "+".join(t["name"] for t in answer["truth"] if t["role"] == "planned") or "nothing"
    faults = [f"named {name} where {hidden} is hidden" for name in marks["wrong"]]
    faults += [f"missed {name}" for name in marks.get("missed") or []]
    if marks.get("thrown"):
        faults.append(f"rows thrown out that {hidden} moves")
    if marks.get("false_calm"):
        faults.append(f"calm where {hidden} is hidden")
    if marks.get("false_unexplained"):
        faults.append("unexplained said of library effects")
    if marks.get("said_unexplained") is False:
        faults.append(f"unexplained not said of {hidden}")
    if abs(marks.get("shrink_error") or 0.0) > 0.05:
        faults.append("shrinkage off by more than 5 points")
    faults += [f"says {one}" for one in marks["contradictions"] or ()]
    faults += [f"worse on {kind} rows" for kind in ("fresh", "transfer") if marks[f"worse_{kind}"]]
    return faults
