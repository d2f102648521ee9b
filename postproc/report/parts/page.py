"""The one design of all pages: a self-contained HTML file that opens offline and prints.

Script and data are embedded; a page makes no request. Large arrays travel as base64 of
little-endian float32 or int32.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from postproc.records import dataclass
from postproc.report.parts.modules import ASSETS, one_script

_SENTENCE = 28
"""Cells longer than this are text, not numbers."""


def escape(text: object) -> str:
    """Return text that shows as itself in HTML."""
    return html.escape(str(text), quote=True)


def packed(values: ArrayLike, dtype: str = "float32") -> dict[str, Any]:
    """Return an array as ``{"type", "shape", "data"}`` with base64 data for the page's scripts."""
    array = np.ascontiguousarray(values, dtype=np.dtype(dtype).newbyteorder("<"))
    data = base64.b64encode(array.tobytes()).decode("ascii")
    return {"type": dtype, "shape": list(array.shape), "data": data}


def packed_text(text: str) -> dict[str, Any]:
    """Return a text as ``{"type": "gzip", "data"}``, for long texts; the same bytes every time."""
    content = gzip.compress(text.encode("utf-8"), compresslevel=9, mtime=0)
    return {"type": "gzip", "data": base64.b64encode(content).decode("ascii")}


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return an HTML table; every cell is escaped. A click on a head cell sorts it."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(_cell(str(cell)) for cell in row) + "</tr>" for row in rows)
    return f'<table class="data"><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>'


def _cell(text: str) -> str:
    """Return a table cell; sentences are set as text, the rest as numbers."""
    mark = ' class="text wrap"' if len(text) > _SENTENCE else ""
    return f"<td{mark}>{escape(text)}</td>"


@dataclass(slots=True)
class Page:
    """A page under construction: title, lead sentences, sections of trusted HTML, script, data.

    ``script`` is the module of the assets folder that the page starts.
    """

    title: str
    lead: Sequence[str] = ()
    sections: list[str] = field(default_factory=list)
    script: str = "page.js"
    data: dict[str, Any] = field(default_factory=dict)

    def section(self, heading: str, body: str, width: str = "") -> None:
        """Add a section; ``width`` is "", ``half``, ``third`` or ``wide``; ``body`` is HTML."""
        self.sections.append(f'<section class="{width}"><h2>{escape(heading)}</h2>{body}</section>')

    def render(self) -> bytes:
        """Return the page as UTF-8 bytes."""
        style = (ASSETS / "page.css").read_text(encoding="utf-8")
        lead = "".join(
            f'<p class="{"lead" if i == 0 else ""}">{escape(line)}</p>'
            for i, line in enumerate(self.lead)
        )
        # "<" inside JSON would let a name of the CAM file end the script element
        data = json.dumps(self.data, allow_nan=False, ensure_ascii=True).replace("<", "\\u003c")
        script = one_script(self.script).replace("</script", "<\\/script")
        return (
            '<!doctype html><html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            '<link rel="icon" href="data:,">'
            f"<title>{escape(self.title)}</title><style>{style}</style></head><body>"
            f"<header><h1>{escape(self.title)}</h1>{lead}</header>"
            f"<main>{''.join(self.sections)}</main>"
            f'<script type="application/json" id="data">{data}</script>'
            f'<script type="module">{script}</script></body></html>\n'
        ).encode()
