"""What differs in the settings that two motions are run with."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from postproc.controller import Blend, Settings, Trace
from postproc.units import DEG, MM


def setting_differences(
    old: Trace,
    new: Trace,
    a: Settings,
    b: Settings,
    is_ptp: bool,
    blend: int,
    share: float,
) -> Iterator[tuple[str, str]]:
    """Yield kind and detail of settings that differ for this kind of motion."""

    def other(x: float, y: float) -> bool:
        return abs(x - y) > share * max(abs(x), abs(y), 1e-12)

    if is_ptp:
        if any(other(x, y) for x, y in zip(a.ptp, b.ptp, strict=True)):
            yield "speed", f"{_percent(a.ptp)} became {_percent(b.ptp)}"
    elif other(a.speed, b.speed):
        yield "speed", f"{a.speed:g} m/s became {b.speed:g} m/s"
    if blend == Blend.DISTANCE and other(a.cdis, b.cdis):
        yield "approximation", f"{a.cdis / MM:g} mm became {b.cdis / MM:g} mm"
    for name in ("tool", "base"):
        detail = _frame(old, new, a, b, name)
        if detail:
            yield name, detail
    if not is_ptp:
        yield from _path(a, b, other)


def _path(
    a: Settings, b: Settings, other: Callable[[float, float], bool]
) -> Iterator[tuple[str, str]]:
    if other(a.orientation_speed, b.orientation_speed):
        before, after = a.orientation_speed / DEG, b.orientation_speed / DEG
        yield "settings", f"$VEL.ORI1 {before:g} became {after:g} deg/s"
    if other(a.acceleration, b.acceleration):
        yield "settings", f"$ACC.CP {a.acceleration:g} became {b.acceleration:g} m/s^2"
    if a.orientation != b.orientation:
        yield "settings", f"$ORI_TYPE #{a.orientation} became #{b.orientation}"
    if a.ipo_tcp != b.ipo_tcp:
        yield "settings", "$IPO_MODE is another"


def _frame(old: Trace, new: Trace, a: Settings, b: Settings, name: str) -> str:
    numbers = getattr(a, f"{name}_number"), getattr(b, f"{name}_number")
    if numbers[0] != numbers[1]:
        before, after = (str(n) if n >= 0 else "frame" for n in numbers)
        return f"{name} {before} became {after}"
    frames = (old.tools, new.tools) if name == "tool" else (old.bases, new.bases)
    T, U = frames[0][getattr(a, name)], frames[1][getattr(b, name)]
    return f"the frame of the {name} is another" if np.abs(T - U).max() > 1e-6 else ""


def _percent(shares: tuple[float, ...]) -> str:
    if len(set(shares)) == 1:
        return f"{shares[0] * 100:g} %"
    return "/".join(f"{value * 100:g}" for value in shares) + " %"
