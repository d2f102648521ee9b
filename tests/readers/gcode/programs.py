"""Random programs that a control runs: every block numbered, so that its motions can be found."""

from __future__ import annotations

import random
import re

import numpy as np

STYLES = {
    "plain": lambda text, _: text,
    "tight": lambda text, _: text if "(" in text else text.replace(" ", ""),
    "lower": lambda text, _: text[:1] + text[1:].lower(),
    "signs": lambda text, _: re.sub(r"([XYZIJK])(?=[\d.])", r"\1+", text),
    "zeros": lambda text, _: re.sub(r"\bG(?=\d\b)", "G0", text),
    "remarks": lambda text, rng: text
    if "(" in text
    else re.sub(r" (?=[XYZIJ])", lambda _: rng.choice([" ", "(go)", " (a) "]), text) + " ; end",
}  # fmt: skip
"""How posts write one and the same block."""


def dressed(text, seed):
    """Return a program of the same meaning: runs of blocks as sub-programs, in another style."""
    rng = random.Random(seed)
    lines, subs = text.strip().split("\n"), []

    def cut(lines, depth):
        if depth > 2 or len(lines) < 8:
            return lines
        first = rng.randrange(1, len(lines) - 4)
        last = first + rng.randrange(2, min(25, len(lines) - first - 1))
        number, place = 100 + len(subs), len(subs)
        subs.append([])
        subs[place] = [f"O{number:04d} (SUB)", *cut(lines[first:last], depth + 1), "M99"]
        return [*lines[:first], f"M98 P{number}", *lines[last:]]

    out = [*lines[:3], *cut(lines[3:-1], 0), "M30", *(line for sub in subs for line in sub)]
    style = STYLES[rng.choice(sorted(STYLES))]
    return "\n".join(line if line[0] == "O" else style(line, rng) for line in out) + "\n"


def program(seed, blocks=60):
    """Return the text of a program of lines, arcs, helices and drill cycles."""
    rng = np.random.default_rng(seed)
    unit = rng.choice(["G20", "G21"])
    per_mm = 1 / 25.4 if unit == "G20" else 1.0
    digits = 6 if unit == "G20" else 5
    at = np.array([0.0, 0.0, 50.0])
    absolute = True
    out = [f"{unit} G90 G17 G94 G40 G49 G80", "T1 M6", "S2000 M3"]
    out += [f"G0 X{0:.1f} Y{0:.1f} Z{50 * per_mm:.{digits}f} F{300 * per_mm:.3f}"]

    def words(target, must=()):
        text = ""
        for axis, letter in enumerate("XYZ"):
            value = (target[axis] if absolute else target[axis] - at[axis]) * per_mm
            if letter in must or abs(target[axis] - at[axis]) > 1e-9:
                text += f" {letter}{value:.{digits}f}"
        return text

    while len(out) < blocks:
        kind = rng.choice(["mode", "rapid", "line", "arc", "radius", "helix", "hole", "stop"])
        target = at + np.round(rng.uniform(-20, 20, 3), 2) * (rng.random(3) < 0.7)
        if kind == "mode":
            absolute = not absolute
            out.append("G90" if absolute else "G91")
        elif kind in ("rapid", "line") and not np.array_equal(target, at):
            feed = f" F{rng.uniform(50, 900) * per_mm:.3f}" if rng.random() < 0.3 else ""
            out.append(("G0" if kind == "rapid" else "G1") + words(target) + feed)
            at = target
        elif kind in ("arc", "helix", "radius"):
            code, order = [("G17", (0, 1, 2)), ("G18", (2, 0, 1)), ("G19", (1, 2, 0))][
                rng.integers(3)
            ]
            radius, start, sweep = rng.uniform(2, 30), *rng.uniform(0, 2 * np.pi, 2)
            left = rng.random() < 0.5
            centre = at[list(order[:2])] - radius * np.array([np.cos(start), np.sin(start)])
            if kind != "radius" and rng.random() < 0.2:
                sweep = 2 * np.pi
            angle = start + (sweep if left else -sweep)
            target = at.copy()
            target[list(order[:2])] = centre + radius * np.array([np.cos(angle), np.sin(angle)])
            if sweep == 2 * np.pi:
                target = at.copy()
            if kind == "helix":
                target[order[2]] += rng.uniform(-5, 5)
            first, second = ("XYZ"[axis] for axis in order[:2])
            text = f"{code} {'G3' if left else 'G2'}" + words(target, first + second)
            if kind == "radius" and 0.3 < sweep < 6.0 and abs(sweep - np.pi) > 0.2:
                size = radius * per_mm * (-1 if sweep > np.pi else 1)
                text += f" R{size:.{digits}f}"
            else:
                for axis, value in zip(order[:2], centre - at[list(order[:2])], strict=True):
                    text += f" {'IJK'[axis]}{value * per_mm:.{digits}f}"
            out += [text, "G17"]
            at = target
        elif kind == "hole":
            level, depth = at[2] - rng.uniform(0, 5), rng.uniform(1, 12)
            code = rng.choice(["G81", "G82", "G83", "G73", "G85", "G89"])
            back = rng.choice(["G98", "G99"])
            z, r = (level - depth, level) if absolute else (-depth, level - at[2])
            text = f"{back} {code}" + words([*target[:2], at[2]], "XY")
            text += f" Z{z * per_mm:.{digits}f} R{r * per_mm:.{digits}f}"
            text += f" Q{3 * per_mm:.4f}" if code in ("G83", "G73") else ""
            text += " P0.5" if code in ("G82", "G89") else ""
            out.append(text)
            at = np.array([*target[:2], at[2] if back == "G98" else level])
            for _ in range(rng.integers(3)):
                target = at + np.round(rng.uniform(1, 20, 3), 2) * [1, 1, 0]
                if not absolute:
                    break  # the level of the next one would count from here
                out.append(words(target, "X").strip())
                at = target
            out.append("G80")
        elif kind == "stop":
            out.append(rng.choice(["M8", "M9", "M0", "M1", "S1500", "G4 P0.25", "(A REMARK)"]))
    lines = [f"N{10 * (k + 1)} {text}" for k, text in enumerate([*out, "M2"])]
    return "\n".join(lines) + "\n"
