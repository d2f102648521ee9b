"""The spin map as a picture: spin about the tool axis by tag, the chosen line on it.

Free cells are coloured by stiffness, the others by what stands against them. A map of more tags
than the picture has columns is drawn in columns of several tags; a column shows what is hardest
among its tags, so nothing that stands in the way is lost.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from postproc.planning import Grade, SpinClass, SpinMap
from postproc.records import dataclass
from postproc.units import DEG, N_PER_MM

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont, ImageFont

    from postproc.arrays import FloatArray, IntArray

MOST_COLUMNS = 1500
"""A map of more tags is drawn with so many columns at most."""
CLASS_WORDS = {
    SpinClass.FREE: "free",
    SpinClass.COLLISION: "collision",
    SpinClass.SINGULAR: "singularity",
    SpinClass.JOINT_LIMIT: "joint limit",
    SpinClass.UNREACHABLE: "out of reach",
}
CLASS_COLOURS = {
    SpinClass.FREE: "#9cc7ea",
    SpinClass.COLLISION: "#c62828",
    SpinClass.SINGULAR: "#7b3fa0",
    SpinClass.JOINT_LIMIT: "#e8a23c",
    SpinClass.UNREACHABLE: "#6b7680",
}
GRADE_COLOURS = {
    Grade.GOOD: "#2e7d32",
    Grade.ACCEPTABLE: "#d4c22a",
    Grade.CRITICAL: "#e07b1a",
    Grade.INVALID: "#c62828",
}
_SOFTEST, _STIFFEST = np.array([226.0, 240.0, 250.0]), np.array([11.0, 78.0, 140.0])
_INK, _SOFT, _PAPER = "#1b2733", "#5b6b7a", "#ffffff"
_WIDTH, _HEIGHT = 1500, 480
_LEFT, _TOP, _RIGHT, _STRIP = 70, 58, 24, 16
_BELOW = 96
_TEXT = 15


@dataclass(frozen=True, slots=True)
class Columns:
    """The map by columns of successive tags.

    ``first``, ``last`` (c,) tags of each; ``classes`` (c, S) the hardest; ``stiffness`` (c, S)
    [N/m] the least, NaN where not all are free; ``low``, ``high`` (c,) chosen spins [rad], NaN
    where none; ``grade`` (c,) the worst.
    """

    first: IntArray
    last: IntArray
    classes: IntArray
    stiffness: FloatArray
    low: FloatArray
    high: FloatArray
    grade: IntArray

    def __len__(self) -> int:
        """Return the number of columns."""
        return len(self.first)


def columns_of(spins: SpinMap, most: int = MOST_COLUMNS) -> Columns:
    """Return a map in at most so many columns of equally many tags (the last may have fewer)."""
    n = len(spins)
    size = -(-n // most)
    first = np.arange(0, n, size)
    has = np.isfinite(spins.chosen)
    low = np.minimum.reduceat(np.where(has, spins.chosen, np.inf), first)
    high = np.maximum.reduceat(np.where(has, spins.chosen, -np.inf), first)
    classes = np.maximum.reduceat(spins.classes, first, axis=0)
    stiffness = np.minimum.reduceat(
        np.where(np.isfinite(spins.stiffness), spins.stiffness, np.inf), first, axis=0
    )
    known = (classes == SpinClass.FREE) & np.isfinite(stiffness)
    return Columns(
        first.astype(np.int32),
        np.append(first[1:] - 1, n - 1).astype(np.int32),
        classes.astype(np.int32),
        np.where(known, stiffness, np.nan),
        np.where(np.isfinite(low), low, np.nan),
        np.where(np.isfinite(high), high, np.nan),
        np.maximum.reduceat(spins.grade, first).astype(np.int32),
    )


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawn map: PNG bytes and where its cells are [px]: left, top, width, height."""

    png: bytes
    box: tuple[int, int, int, int]
    size: tuple[int, int]
    columns: Columns


def draw(spins: SpinMap) -> Picture:
    """Return a map drawn as PNG, axes and legend in the picture."""
    from PIL import Image, ImageDraw

    columns = columns_of(spins)
    wide = len(columns) * max(1, _WIDTH // len(columns))
    box = (_LEFT, _TOP, wide, _HEIGHT)
    size = (max(_LEFT + wide + _RIGHT, 900), _TOP + _HEIGHT + _BELOW)
    picture = Image.new("RGB", size, _PAPER)
    # first spin at the bottom
    cells = Image.fromarray(np.swapaxes(_colours(columns), 0, 1)[::-1].astype(np.uint8))
    picture.paste(cells.resize((wide, _HEIGHT), Image.Resampling.NEAREST), (_LEFT, _TOP))
    pen = _Pen(ImageDraw.Draw(picture), _font(), box)
    pen.grades(columns)
    pen.line(columns, spins.spins)
    pen.spin_axis(spins.spins)
    pen.tag_axis(columns, spins)
    pen.legend(columns)
    stream = io.BytesIO()
    picture.save(stream, "PNG", optimize=True)
    return Picture(stream.getvalue(), box, size, columns)


def _colours(columns: Columns) -> FloatArray:
    """Return the colours (c, S, 3) 0..255 of all cells."""
    result = np.array([_rgb(CLASS_COLOURS[kind]) for kind in SpinClass])[columns.classes]
    known = np.isfinite(columns.stiffness)
    if known.any():
        low, high = columns.stiffness[known].min(), columns.stiffness[known].max()
        share = (columns.stiffness[known] - low) / ((high - low) or 1.0)
        result[known] = _SOFTEST + share[:, None] * (_STIFFEST - _SOFTEST)
    return np.asarray(np.round(result))


def _rgb(colour: str) -> tuple[float, float, float]:
    return int(colour[1:3], 16) * 1.0, int(colour[3:5], 16) * 1.0, int(colour[5:7], 16) * 1.0


def _font() -> FreeTypeFont | ImageFont:
    from PIL import ImageFont

    return ImageFont.load_default(_TEXT)


@dataclass(frozen=True, slots=True)
class _Pen:
    """Draws on the picture around its cells."""

    draw: ImageDraw
    font: FreeTypeFont | ImageFont
    box: tuple[int, int, int, int]

    def grades(self, columns: Columns) -> None:
        """Draw the criteria classes as a strip above the cells."""
        left, top, wide, _ = self.box
        step = wide / len(columns)
        for k, grade in enumerate(columns.grade.tolist()):
            area = (left + k * step, top - _STRIP, left + (k + 1) * step - 1, top - 4)
            self.draw.rectangle(area, fill=GRADE_COLOURS[Grade(grade)])

    def line(self, columns: Columns, spins: FloatArray) -> None:
        """Draw the chosen spins: a bar over the range of each column, joined where they run on."""
        left, _, wide, _ = self.box
        step = wide / len(columns)
        for colour, width in ((_PAPER, 5), (_INK, 2)):
            before: tuple[float, float] | None = None
            for k in range(len(columns)):
                if not np.isfinite(columns.low[k]):
                    before = None
                    continue
                low, high = self.y(columns.low[k], spins), self.y(columns.high[k], spins)
                a, b = left + k * step, left + (k + 1) * step
                if before is not None and abs(before[1] - low) < 0.5 * self.box[3]:
                    self.draw.line((*before, 0.5 * (a + b), low), fill=colour, width=width)
                self.draw.line((a, low, b, low), fill=colour, width=width)
                if low - high > 1.0:
                    self.draw.line((0.5 * (a + b), low, 0.5 * (a + b), high), colour, width)
                before = (0.5 * (a + b), low)

    def y(self, spin: float, spins: FloatArray) -> float:
        """Return the height of a spin [px]."""
        step = float(spins[1] - spins[0]) if len(spins) > 1 else 1.0
        share = (spin - float(spins[0]) + 0.5 * step) / (step * len(spins))
        return self.box[1] + self.box[3] * (1.0 - share)

    def spin_axis(self, spins: FloatArray) -> None:
        """Label the spins at the left."""
        low, high = float(spins[0]) / DEG, float(spins[-1]) / DEG
        step = next((s for s in (1, 5, 10, 15, 30, 45, 90) if (high - low) / s <= 13.0), 90)
        for value in range(int(np.ceil(low / step - 1e-9)) * step, int(high + 1e-9) + 1, step):
            at = self.y(value * DEG, spins)
            self.draw.line((self.box[0] - 6, at, self.box[0] - 1, at), fill=_SOFT)
            self.text(self.box[0] - 10, at, f"{value}", "rm")
        self.text(8, 20, "spin about the tool axis [deg]", "lm")

    def tag_axis(self, columns: Columns, spins: SpinMap) -> None:
        """Name some tags below the cells."""
        left, top, wide, high = self.box
        step = wide / len(columns)
        shown = max(1, -(-len(columns) * 110 // max(wide, 1)))
        path = spins.plan.toolpath
        for k in range(0, len(columns), shown):
            at = left + (k + 0.5) * step
            self.draw.line((at, top + high, at, top + high + 5), fill=_SOFT)
            self.text(at, top + high + 14, path.tag_name(int(columns.first[k]))[:12], "mm")
        size = int(columns.last[0] - columns.first[0]) + 1
        words = (
            "tag" if size == 1 else f"tag; a column is {size} tags and shows the hardest of them"
        )
        self.text(left, top + high + 36, words, "lm")

    def legend(self, columns: Columns) -> None:
        """Draw what the colours mean."""
        at, row = float(self.box[0]), self.box[1] + self.box[3] + 66
        known = columns.stiffness[np.isfinite(columns.stiffness)] / N_PER_MM
        if len(known):
            for i in range(80):
                colour = _SOFTEST + i / 79 * (_STIFFEST - _SOFTEST)
                rgb = (int(colour[0]), int(colour[1]), int(colour[2]))
                self.draw.line((at + i, row - 7, at + i, row + 7), fill=rgb)
            words = f"free, {known.min():.0f} to {known.max():.0f} N/mm"
            at = self.text(at + 88, row, words, "lm") + 22
        kinds = [k for k in SpinClass if k is not SpinClass.FREE or not len(known)]
        for kind in kinds:
            at = self._key(at, row, CLASS_COLOURS[kind], CLASS_WORDS[kind])
        self.draw.line((at, row, at + 18, row), fill=_INK, width=2)
        self.text(at + 24, row, "chosen", "lm")
        above = self.text(float(self.box[0]) + 260.0, 20, "margin to limits:", "lm") + 14
        for grade in Grade:
            above = self._key(above, 20, GRADE_COLOURS[grade], grade.name.lower())

    def _key(self, at: float, row: int, colour: str, words: str) -> float:
        self.draw.rectangle((at, row - 7, at + 14, row + 7), fill=colour)
        return self.text(at + 20, row, words, "lm") + 22

    def text(self, x: float, y: float, words: str, anchor: str) -> float:
        """Write words; return where they end [px]."""
        self.draw.text((x, y), words, fill=_SOFT, font=self.font, anchor=anchor)
        return x + float(self.font.getlength(words))
