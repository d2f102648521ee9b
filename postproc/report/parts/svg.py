"""Charts as inline SVG text, drawn when the page is made: no script, they print as they are."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray
from postproc.records import dataclass
from postproc.report.parts.page import escape

COLOURS = ("#0b6bcb", "#c62828", "#2e7d32", "#b26a00", "#6a1b9a", "#00838f")
_LEFT, _RIGHT, _TOP, _BOTTOM = 62.0, 14.0, 26.0, 38.0


@dataclass(frozen=True, slots=True)
class Series:
    """A line or a row of bars: values (n,), optional error bars low and high (n,)."""

    name: str
    x: FloatArray
    y: FloatArray
    low: FloatArray | None = None
    high: FloatArray | None = None
    marks: bool = False


def line_chart(
    series: Sequence[Series],
    x_label: str,
    y_label: str,
    levels: Sequence[tuple[str, float]] = (),
    size: tuple[int, int] = (560, 260),
    log_y: bool = False,
) -> str:
    """Return a line chart; gaps where values are not finite.

    Args:
        series: lines.
        x_label: of the x axis.
        y_label: of the y axis.
        levels: named horizontal lines.
        size: width and height [px].
        log_y: logarithmic y axis.
    """
    xs = np.concatenate([s.x for s in series]) if series else np.zeros(0)
    ys = [v for s in series for v in (s.y, s.low, s.high) if v is not None]
    values = np.concatenate([*ys, [level for _, level in levels]]) if ys else np.zeros(0)
    values = values[np.isfinite(values) & ((values > 0.0) | (not log_y))]
    if not len(values) or not len(xs):
        return "<p>nothing to show</p>"
    frame = _Frame.around(xs, values, size, log_y)
    parts = [frame.axes(x_label, y_label)]
    for k, s in enumerate(series):
        colour = COLOURS[k % len(COLOURS)]
        if s.low is not None and s.high is not None:
            parts.append(frame.whiskers(s.x, s.low, s.high, colour))
        parts.append(frame.path(s.x, s.y, colour, s.marks))
    for name, level in levels:
        parts.append(frame.level(level, name))
    parts.append(_legend([s.name for s in series], y_label))
    return _svg(size, "".join(parts))


def bar_chart(
    names: Sequence[str],
    series: Sequence[Series],
    y_label: str,
    levels: Sequence[tuple[str, float]] = (),
    size: tuple[int, int] = (560, 260),
) -> str:
    """Return grouped bars: one group a name, one bar a series (``x`` is not used)."""
    values = np.concatenate([*(s.y for s in series), [0.0], [level for _, level in levels]])
    values = values[np.isfinite(values)]
    frame = _Frame.around(np.array([0.0, float(len(names))]), values, size, False)
    parts = [frame.axes("", y_label, with_x=False)]
    width = 0.8 / max(len(series), 1)
    zero = frame.y(0.0)
    for k, s in enumerate(series):
        for i, value in enumerate(s.y):
            if not math.isfinite(value):
                continue
            left = frame.x(i + 0.1 + k * width)
            right = frame.x(i + 0.1 + (k + 1) * width) - 1.0
            top = frame.y(float(value))
            parts.append(
                f'<rect x="{left:.1f}" y="{min(top, zero):.1f}" width="{right - left:.1f}" '
                f'height="{abs(zero - top):.1f}" fill="{COLOURS[k % len(COLOURS)]}">'
                f"<title>{escape(s.name)} {escape(names[i])}: {value:.4g}</title></rect>"
            )
    for i, name in enumerate(names):
        parts.append(_text(frame.x(i + 0.5), size[1] - _BOTTOM + 15, name, "middle"))
    for name, level in levels:
        parts.append(frame.level(level, name))
    parts.append(_legend([s.name for s in series], y_label))
    return _svg(size, "".join(parts))


def space_view(
    points: FloatArray,
    colours: Sequence[str],
    boxes: Sequence[tuple[FloatArray, FloatArray]],
    titles: Sequence[str] = (),
    size: tuple[int, int] = (640, 420),
) -> str:
    """Return points (n, 3) and boxes (low, high) in parallel projection, x to the front left."""
    view = np.array([[-0.72, 0.69, 0.0], [-0.30, -0.31, 0.90]])
    corners = [
        np.array([[x, y, z] for x in (a[0], b[0]) for y in (a[1], b[1]) for z in (a[2], b[2])])
        for a, b in boxes
    ]
    flat = np.vstack([points, *corners]) @ view.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = float(min((np.array(size) - 30.0) / np.maximum(high - low, 1e-9)))

    def place(p: FloatArray) -> FloatArray:
        moved = (p @ view.T - low) * scale + 15.0
        moved[..., 1] = size[1] - moved[..., 1]
        return np.asarray(moved)

    edges = [(i, j) for i in range(8) for j in range(i) if bin(i ^ j).count("1") == 1]
    parts = []
    for box in corners:
        at = place(box)
        path = "".join(
            f"M{at[i][0]:.1f} {at[i][1]:.1f}L{at[j][0]:.1f} {at[j][1]:.1f}" for i, j in edges
        )
        parts.append(f'<path d="{path}" stroke="#b7c2cc" fill="none" stroke-width="0.7"/>')
    for i, at in enumerate(place(points)):
        title = f"<title>{escape(titles[i])}</title>" if titles else ""
        parts.append(
            f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="2.6" fill="{colours[i]}">'
            f"{title}</circle>"
        )
    return _svg(size, "".join(parts))


@dataclass(frozen=True, slots=True)
class _Frame:
    """The plotted rectangle and its two scales."""

    low: tuple[float, float]
    high: tuple[float, float]
    size: tuple[int, int]
    log_y: bool

    @classmethod
    def around(
        cls, xs: ArrayLike, values: FloatArray, size: tuple[int, int], log_y: bool
    ) -> _Frame:
        x0, x1 = float(np.min(xs)), float(np.max(xs))
        y0, y1 = float(values.min()), float(values.max())
        if log_y:
            y0, y1 = math.log10(y0), math.log10(y1)
        if x0 == x1:
            x0, x1 = x0 - 1.0, x1 + 1.0
        pad = 0.05 * (y1 - y0) or 0.5 * abs(y1) or 1.0
        return cls((x0, y0 - pad if y0 != 0.0 else y0), (x1, y1 + pad), size, log_y)

    def x(self, value: float) -> float:
        share = (value - self.low[0]) / (self.high[0] - self.low[0])
        return _LEFT + share * (self.size[0] - _LEFT - _RIGHT)

    def y(self, value: float) -> float:
        shown = math.log10(value) if self.log_y else value
        share = (shown - self.low[1]) / (self.high[1] - self.low[1])
        return self.size[1] - _BOTTOM - share * (self.size[1] - _TOP - _BOTTOM)

    def axes(self, x_label: str, y_label: str, with_x: bool = True) -> str:
        width, height = self.size
        parts = []
        for value in self._ticks_y():
            at = self.y(value)
            parts.append(
                f'<line x1="{_LEFT}" x2="{width - _RIGHT}" y1="{at:.1f}" y2="{at:.1f}" '
                'stroke="#e3e8ec"/>'
            )
            parts.append(_text(_LEFT - 6, at + 4, f"{value:.4g}", "end"))
        for value in _ticks(self.low[0], self.high[0], 8) if with_x else []:
            parts.append(_text(self.x(value), height - _BOTTOM + 15, f"{value:.4g}", "middle"))
        parts.append(_text(width - _RIGHT, height - 6, x_label, "end"))
        parts.append(_text(4, 12, y_label, "start"))
        return "".join(parts)

    def path(self, x: FloatArray, y: FloatArray, colour: str, marks: bool) -> str:
        d, pen, dots = "", False, ""
        for a, b in zip(x, y, strict=True):
            if not math.isfinite(b) or (self.log_y and b <= 0.0):
                pen = False
                continue
            d += f"{'L' if pen else 'M'}{self.x(float(a)):.1f} {self.y(float(b)):.1f}"
            pen = True
            if marks:
                dots += (
                    f'<circle cx="{self.x(float(a)):.1f}" cy="{self.y(float(b)):.1f}" r="2.5" '
                    f'fill="{colour}"/>'
                )
        return f'<path d="{d}" fill="none" stroke="{colour}" stroke-width="1.4"/>{dots}'

    def whiskers(self, x: FloatArray, low: FloatArray, high: FloatArray, colour: str) -> str:
        d = ""
        for a, b, c in zip(x, low, high, strict=True):
            if math.isfinite(b) and math.isfinite(c) and (b > 0.0 or not self.log_y):
                at = self.x(float(a))
                d += f"M{at:.1f} {self.y(float(b)):.1f}L{at:.1f} {self.y(float(c)):.1f}"
        return f'<path d="{d}" fill="none" stroke="{colour}" stroke-opacity="0.45"/>'

    def level(self, value: float, name: str) -> str:
        at = self.y(value)
        line = (
            f'<line x1="{_LEFT}" x2="{self.size[0] - _RIGHT}" y1="{at:.1f}" y2="{at:.1f}" '
            'stroke="#5b6b7a" stroke-dasharray="4 3"/>'
        )
        return line + _text(self.size[0] - _RIGHT - 2, at - 4, name, "end")

    def _ticks_y(self) -> list[float]:
        if not self.log_y:
            return _ticks(self.low[1], self.high[1], 5)
        powers = range(math.floor(self.low[1]), math.ceil(self.high[1]) + 1)
        values = [m * 10.0**p for p in powers for m in (1.0, 2.0, 5.0)]
        shown = [v for v in values if self.low[1] <= math.log10(v) <= self.high[1]]
        if len(shown) < 3:
            return _ticks(10.0 ** self.low[1], 10.0 ** self.high[1], 4)
        return shown


def _ticks(low: float, high: float, count: int) -> list[float]:
    raw = (high - low) / count or 1.0
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(k * power for k in (1.0, 2.0, 5.0, 10.0) if k * power >= raw * (1.0 - 1e-12))
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [k * step + 0.0 for k in range(first, last + 1)]


def _legend(names: Sequence[str], beside: str) -> str:
    parts, x = [], max(_LEFT, 16.0 + 6.2 * len(beside))
    for k, name in enumerate(names):
        if not name:
            continue
        colour = COLOURS[k % len(COLOURS)]
        parts.append(f'<rect x="{x:.0f}" y="15" width="10" height="4" fill="{colour}"/>')
        parts.append(_text(x + 14, 21, name, "start"))
        x += 24.0 + 6.4 * len(name)
    return "".join(parts)


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _svg(size: tuple[int, int], body: str) -> str:
    width, height = size
    return (
        f'<svg viewBox="0 0 {width} {height}" width="100%" '
        f'style="max-width:{width * 2}px">{body}</svg>'
    )
