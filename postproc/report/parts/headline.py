"""A diagnosis in one sentence."""

from __future__ import annotations

from typing import Any

from postproc.gap import noise_like

_ENOUGH = 0.6
"""Share of the explained gap from which on one or two joints are worth naming."""


def headline(content: dict[str, Any]) -> str:
    """Return the sentence that a diagnosis page leads with, from its document."""
    gap, total = content["gap"]["rms_mm"], content["shrinkage"]
    if content["verdict"] == "no_gap":
        return f"No gap: what is measured, {gap:.3f} mm, {noise_like(content)}."
    if content["verdict"] == "undetermined" and not content["adopted"]:
        return f"Undetermined: nothing tells whether the {gap:.3f} mm gap is more than noise."
    adopted = [item for item in content["effects"] if item["adopted"]]
    if not adopted:
        return (
            f"Unexplained: none of the effects that are known here accounts for the {gap:.2f} mm "
            "gap."
        )
    share = total["value"]
    what = "Perhaps part" if total["ci"][0] <= 0.0 else "Most" if share >= 0.5 else "Part"
    what += f" of the {gap:.2f} mm gap, {100 * share:.0f} %, "
    if len(adopted) == 1:
        causes, they = f"has one cause: {adopted[0]['title']}", "it"
    else:
        others = " and ".join(item["name"].replace("_", " ") for item in adopted[1:])
        causes = f"has {len(adopted)} causes: {adopted[0]['title']}; then {others}"
        they = "them"
    sentence = (
        f"{what}{causes}{_joints(content)}; adding {they} to the model leaves "
        f"{total['rms_after_mm']:.3f} mm"
    )
    if content["verdict"] == "unexplained":
        return f"{sentence}, and that is more than noise: something else is there, unexplained."
    return f"{sentence}.{_confounded(adopted)}"


def _joints(content: dict[str, Any]) -> str:
    """Return where it enters, when one or two joints carry most of it."""
    joints = sorted(content["where"]["joints"], key=lambda item: -item["share"])
    for count in (1, 2):
        if sum(item["share"] for item in joints[:count]) >= _ENOUGH:
            named = " and ".join(str(item["joint"]) for item in joints[:count])
            return f", mostly at joint{'s' if count > 1 else ''} {named}"
    return ""


def _confounded(adopted: list[dict[str, Any]]) -> str:
    twins = [(item["name"], item["confounded_with"]) for item in adopted if item["confounded_with"]]
    return "".join(
        f" These rows cannot tell {name} from {' or '.join(others)}." for name, others in twins
    )
