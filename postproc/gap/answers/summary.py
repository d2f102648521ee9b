"""A diagnosis in plain words, for a person at the machine."""

from __future__ import annotations

from typing import Any

from postproc.gap.robot_model import effect_of
from postproc.measurement import Remark

_SEEN = 0.01
"""Probability by chance below which a page does not call a rest noise without a word."""
_SURE = 0.9
"""Probability from which a cause is not called open."""


def summary(content: dict[str, Any]) -> list[str]:
    """Return the lines of a plain-language summary of a diagnosis document."""
    gap, rest = content["gap"], content["residual"]
    lines = [
        f"The robot misses the simulation by {gap['rms_mm']:.3f} mm rms"
        f" (95 % within {gap['p95_mm']:.3f}, largest {gap['max_mm']:.3f});"
        f" {noise_words(content['noise'])}."
    ]
    if content["registration"] and content["registration"]["loads_at"] == "reflector":
        lines.append(
            "The loads act at the reflector, not at the cell's tool point: so say the rows."
        )
    lines += _causes(content)
    lines += _model(content)
    if content["verdict"] == "no_gap":
        lines.append(f"No gap: what is measured {noise_like(content)}.")
    elif content["verdict"] == "explained":
        left = noise_like(content)
        lines.append(f"Explained: what remains, {rest['rms_mm']:.3f} mm, {left}.")
    elif content["verdict"] == "undetermined":
        lines.append(
            f"Undetermined: whether the {rest['rms_mm']:.3f} mm that remain are noise cannot be"
            " said. Measure some poses again, from one side."
        )
    else:
        lines += _unexplained(rest)
    lines += [
        f"  {part['rms_mm']:.3f} mm of the rest follow {part['class']} ({part['of']}:"
        f" {part['shape']})."
        for part in content["unexplained"]
    ]
    if content["orientation"]:
        check = content["orientation"]
        lines.append(
            f"Measured orientations, which no fit has seen: {check['rms_before_deg']:.4f} deg rms"
            f" off before, {check['rms_after_deg']:.4f} with what was adopted."
        )
    lines += [Remark(**item).line() for item in content["remarks"]]
    if content["outliers"]:
        shown = ", ".join(content["outliers"][:8])
        lines.append(f"Measuring faults left out ({len(content['outliers'])}): {shown}")
    for item in content["not_testable"]:
        lines.append(f"Not testable: {item['name']} (needs {', '.join(item['needs'])})")
    if content["next_measurements"]:
        first = content["next_measurements"][0]
        lines.append(f"Measure next: {len(content['next_measurements'])} poses; {first['why']}.")
    return lines


def noise_words(noise: dict[str, Any]) -> str:
    """Return how large the noise is and how that is known.

    Args:
        noise: entry of the document.
    """
    if noise["sigma_mm"] is None:
        return (
            "how large the noise is nothing tells: no pose was measured again, and neither the"
            " file nor the cell says what the instrument can"
        )
    text = f"noise {noise['sigma_mm']:.3f} mm per axis, "
    if noise["source"] == "repeats":
        text += f"from {noise['repeats']} repeated readings"
    else:
        text += "as file or cell say of the instrument"
    if noise["correlation_s"]:
        text += f", part of it a wander over {noise['correlation_s'] / 60:.0f} min"
    if noise["drift"]:
        text += f"; revisited poses show a {noise['drift']} in time"
    return text + (f"; but {noise['conflict']}" if noise["conflict"] else "")


def noise_like(content: dict[str, Any]) -> str:
    """Return what may be said of a rest that is no larger than noise: the tests decide."""
    seen = [test for test in content["residual"]["depends_on"] if test["p_value"] < _SEEN]
    if not seen:
        return "looks like noise"
    words = ", ".join(f"{test['name']} (p = {test['p_value']:.2g})" for test in seen[:3])
    return f"is no larger than noise, but follows {words}"


def is_ambiguous(content: dict[str, Any]) -> bool:
    """Return whether a cause is open: a set, one not surely there nor surely not, or a rest."""

    def is_open(item: dict[str, Any]) -> bool:
        if not item["adopted"]:
            return bool(item["probability"] > 1.0 - _SURE)
        return bool(item["confounded_with"] or item["rival"] or item["probability"] < _SURE)

    verdict_is_open = content["verdict"] not in ("explained", "no_gap")
    return verdict_is_open or any(is_open(item) for item in content["effects"])


def _causes(content: dict[str, Any]) -> list[str]:
    lines = []
    for item in content["effects"]:
        if not item["adopted"]:
            continue
        low, high = item["shrinkage_ci"]
        line = (
            f"Cause: {item['title']} ({item['name']}): with it in the model"
            f" {item['rms_before_mm']:.3f} mm become {item['rms_after_mm']:.3f} on rows not fitted"
            f" ({100 * item['shrinkage']:.0f} %, 90 % interval {100 * low:.0f} to"
            f" {100 * high:.0f})."
        )
        if item["confounded_with"]:
            line += f" These rows cannot tell it from {', '.join(item['confounded_with'])}."
        if item["rival"]:
            line += f" In its place {item['rival']} explains more."
        lines += [line, *_leading(item), f"  What to do: {effect_of(item['name']).action}."]
        worse = [d["design"] for d in item["transfer"] if d["gain_nats"] < 0.0]
        if worse:
            lines.append(
                f"  Careful: fitted without {', '.join(worse)}, it makes those rows worse."
            )
    return lines


def _model(content: dict[str, Any]) -> list[str]:
    """Return in what the model file differs from the causes."""
    lines = [
        f"{name} is not in the model: the measuring device may have caused the same. If it is"
        f" the arm's, diagnose with --accept {name}."
        for name in content["withheld"]
    ]
    if content["serving"]:
        lines.append(
            f"The model also holds {', '.join(content['serving'])}: no causes that these rows can"
            " name, but with them it misses rows not fitted by less."
        )
    return lines


def _leading(item: dict[str, Any]) -> list[str]:
    """Return what to doubt where joints lead that play would let stay behind."""
    leading = item["parameters"].get("leading_joints", [])
    if not leading:
        return []
    least = item["interval_90"]["low"]["half_gap_deg"]
    sure = [joint for joint, gap in enumerate(least, start=1) if gap]
    names = ", ".join(f"A{joint}" for joint in leading)
    if len(sure) > 1 and set(sure) <= set(leading):
        return [
            "  Careful: every joint that shows it leads where play would let it stay behind"
            f" ({names}): the dir columns look inverted; +1 is an angle that was growing. If"
            " so, turn their signs before anything is entered in the controller."
        ]
    return [f"  Careful: {names} lead where play would let them stay behind."]


def _unexplained(rest: dict[str, Any]) -> list[str]:
    clear = [d["name"] for d in rest["depends_on"] if d["p_value"] < 1e-3][:4]
    line = f"Unexplained: {rest['rms_mm']:.3f} mm remain"
    line += f" and follow {', '.join(clear)}." if clear else "."
    lines = [line + " No effect of the library that these rows can show explains it."]
    lines += [f"  It {item['title']}. {item['action']}." for item in rest["resembles"]]
    if rest["ripple"]:
        waves = ", ".join(
            f"axis {w['joint']} at {w['periods_per_turn']:g} per turn" for w in rest["ripple"][:5]
        )
        lines.append(f"  Ripple of joint angles in it: {waves}.")
    return lines
