"""What a diagnosis says at a glance: where, which, how far, how the noise is known, one doubt."""

from __future__ import annotations

from typing import Any

_LIKELY = 0.9
_SEEN = 0.01
"""Probability by chance below which a rest is said to follow time."""
_LITTLE = 0.5
"""Share of the gap below which what the causes take of it is said to be little."""


def where_joint(content: dict[str, Any]) -> str:
    """Return at which joint most of the explained gap of a diagnosis' document enters."""
    joints = sorted(content["where"]["joints"], key=lambda item: -item["share"])
    if not joints or not content["adopted"]:
        return "No cause is named, so no joint is."
    first = joints[0]
    return f"{_percent(first['share'])} of what is explained enters at A{first['joint']}."


def where_place(content: dict[str, Any]) -> str:
    """Return where in space the gap is largest, with its usual size."""
    cells = content["where"]["cells"]
    usual = content["gap"]["rms_mm"]
    if not cells:
        return f"{usual:.3f} mm rms."
    worst = cells[0]
    middle = [0.5 * (a + b) for a, b in zip(worst["min_mm"], worst["max_mm"], strict=True)]
    at = ", ".join(f"{v:.0f}" for v in middle)
    return f"Largest around ({at}) mm: {worst['rms_mm']:.3f} mm rms, {usual:.3f} over all rows."


def where_time(content: dict[str, Any]) -> str:
    """Return what of the gap follows time."""
    drift = content["noise"]["drift"]
    if drift:
        return f"Revisited poses show a {drift} in time."
    late = [part for part in content["unexplained"] if part["class"] == "time"]
    if late:
        return f"{late[0]['rms_mm']:.3f} mm of the rest follow time: {late[0]['shape']}."
    seen = [test for test in content["residual"]["depends_on"] if test["name"] == "time"]
    if any(test["p_value"] < _SEEN for test in seen):
        return f"{seen[0]['rms_mm']:.3f} mm of the rest follow time (p = {seen[0]['p_value']:.2g})."
    return "Nothing is seen to follow time."


def which(content: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Return causes, then classes of what no cause explains: name, how sure, what it takes."""
    rows = []
    for item in content["effects"]:
        if not item["adopted"]:
            continue
        names = [item["name"], *item["confounded_with"]]
        took = item["rms_before_mm"] - item["rms_after_mm"]
        name = " or ".join(name.replace("_", " ") for name in names)
        rows.append((name, _percent(item["probability"]), f"{took:.3f} mm"))
    rows += [
        (f"no known cause, follows {part['class']}: {part['of']} ({part['shape']})", "class",
         f"{part['rms_mm']:.3f} mm")
        for part in content["unexplained"]
    ]  # fmt: skip
    return rows


def how_far(content: dict[str, Any]) -> list[str]:
    """Return how far the model shrinks the gap on rows that no fit has seen.

    Then, where an earlier campaign was given, what came of its compensation.
    """
    total, promise = content["shrinkage"], content.get("before")
    lines = ["Nothing is adopted: the model stays as it is."]
    if content["adopted"] or content["serving"]:
        low, high = total["ci"]
        lines = [
            f"{total['rms_before_mm']:.3f} mm become {total['rms_after_mm']:.3f} on rows that no"
            f" fit has seen: {_percent(total['value'])} less (90 % interval {_percent(low)} to"
            f" {_percent(high)})."
        ]
    if promise:
        word = "as promised" if promise["kept"] else "less than promised"
        lines.append(
            f"Compensated: {promise['rms_before_mm']:.3f} mm became"
            f" {promise['rms_after_mm']:.3f}, {_percent(promise['shrinkage'])} less;"
            f" {_percent(promise['promised'])} were promised: {word}."
        )
    return lines


def doubt(content: dict[str, Any]) -> str:
    """Return the one thing to doubt first."""
    adopted = [item for item in content["effects"] if item["adopted"]]
    if content["noise"]["sigma_mm"] is None:
        return "How large the noise is nobody knows: revisit some poses from one side."
    if content["noise"]["conflict"]:
        return f"The noise: {content['noise']['conflict']}."
    if content["verdict"] == "unexplained":
        rest = content["residual"]["structured_rms_mm"]
        return f"{rest:.3f} mm are left that are not noise: something is missing in the list."
    return _other_cause(adopted) or _weakest(content, adopted)


def _other_cause(adopted: list[dict[str, Any]]) -> str:
    """Return what speaks against the first name that something speaks against."""
    for item in adopted:
        if item["confounded_with"]:
            others = " or ".join(item["confounded_with"])
            return f"{item['name']} may as well be {others}: these rows cannot tell."
    for item in adopted:
        if item["rival"]:
            return f"{item['name']} may be another cause: {item['rival']} explains more."
    for item in adopted:
        worse = [one["design"] for one in item["transfer"] if one["gain_nats"] < 0.0]
        if worse:
            return f"{item['name']} makes rows of {worse[0]} worse when it is fitted without them."
    return ""


def _weakest(content: dict[str, Any], adopted: list[dict[str, Any]]) -> str:
    total = content["shrinkage"]
    unsure = min(adopted, key=lambda item: float(item["probability"]), default=None)
    if unsure is not None and unsure["probability"] < _LIKELY:
        return f"{unsure['name']} is the least sure: {_percent(unsure['probability'])}."
    if adopted and total["value"] < _LITTLE:
        return f"All causes together take only {_percent(total['value'])} of the gap."
    if content["outliers"]:
        count = len(content["outliers"])
        return f"{count} rows were left out as measuring faults; look at them."
    if content["not_testable"]:
        item = content["not_testable"][0]
        return f"{item['name']} could not be tested: {', '.join(item['needs'])} was not logged."
    if unsure is not None:
        low, high = unsure["shrinkage_ci"]
        return (
            f"Of all causes {unsure['name']} is the least sure: on rows not fitted it takes"
            f" {_percent(low)} to {_percent(high)}."
        )
    return "A gap that is the same in all rows would look like a wrong frame."


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"
