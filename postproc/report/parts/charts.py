"""Charts as data for the page's scripts, and points in space as a picture of the page's text."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from postproc.arrays import FloatArray
from postproc.records import dataclass
from postproc.report.parts.page import escape

_SPACE = (640, 420)
"""Width and height of points in space."""
_SHADES = ("#cfd8dc", "#ffcc80", "#fb8c00", "#d84315", "#7f0000")


@dataclass(frozen=True, slots=True)
class Series:
    """A line or a row of bars: values (n,), optional error bars low and high (n,)."""

    name: str
    x: FloatArray
    y: FloatArray
    low: FloatArray | None = None
    high: FloatArray | None = None
    marks: bool = False

    def to_page(self) -> dict[str, object]:
        """Return the series for the page's scripts."""
        values = {"x": self.x, "y": self.y, "low": self.low, "high": self.high}
        return {
            "name": self.name,
            "dots": self.marks,
            **{key: _numbers(v) for key, v in values.items() if v is not None},
        }


def line_chart(
    series: Sequence[Series],
    x_label: str,
    y_label: str,
    levels: Sequence[tuple[str, float]] = (),
    size: tuple[int, int] = (560, 260),
    log_y: bool = False,
) -> str:
    """Return a line chart of ``size`` [px] with named horizontal lines; gaps where not finite."""
    return _chart(series, levels, size, {"xLabel": x_label, "yLabel": y_label, "log": log_y})


def bar_chart(
    names: Sequence[str],
    series: Sequence[Series],
    y_label: str,
    levels: Sequence[tuple[str, float]] = (),
    size: tuple[int, int] = (560, 260),
) -> str:
    """Return grouped bars: one group a name, one bar a series (``x`` is not used)."""
    return _chart(series, levels, size, {"xLabel": "", "yLabel": y_label, "names": list(names)})


def _chart(
    series: Sequence[Series],
    levels: Sequence[tuple[str, float]],
    size: tuple[int, int],
    labels: dict[str, object],
) -> str:
    chart = {
        "series": [one.to_page() for one in series],
        "levels": [{"text": text, "y": float(y)} for text, y in levels if np.isfinite(y)],
        "height": size[1],
        **labels,
    }
    width = f"max-width:{2 * size[0]}px"
    return f'<div style="{width}" data-chart="{escape(json.dumps(chart, allow_nan=False))}"></div>'


def _numbers(values: FloatArray) -> list[float | None]:
    """Return values to six digits, None where they are not finite."""
    return [float(f"{v:.6g}") if np.isfinite(v) else None for v in np.ravel(values).tolist()]


def shaded_view(
    points: FloatArray, size_mm: FloatArray, titles: Sequence[str], size: tuple[int, int] = _SPACE
) -> str:
    """Return points (n, 3) in parallel projection, the larger their ``size_mm`` the darker."""
    low, high = np.quantile(size_mm, [0.05, 0.98])
    share = np.clip((size_mm - low) / max(float(high - low), 1e-9), 0.0, 1.0)
    colours = [_SHADES[round(s * (len(_SHADES) - 1))] for s in share.tolist()]
    dots = [f'<span style="color:{_SHADES[end]}">&#9679;</span>' for end in (0, -1)]
    foot = f"<p>{dots[0]} {low:.3f} mm or less {dots[1]} {high:.3f} or more</p>"
    return space_view(points, colours, [], titles, size) + foot


def space_view(
    points: FloatArray,
    colours: Sequence[str],
    boxes: Sequence[tuple[FloatArray, FloatArray]],
    titles: Sequence[str] = (),
    size: tuple[int, int] = _SPACE,
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
    width, height = size
    style = f"max-width:{width * 2}px"
    view_box = f"0 0 {width} {height}"
    return f'<svg viewBox="{view_box}" width="100%" style="{style}">{"".join(parts)}</svg>'
