"""The one design of all pages: a self-contained HTML file that opens offline and prints.

Script and data are embedded; a page makes no request. Large arrays travel as base64 of
little-endian float32 or int32.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from postproc.errors import Finding
from postproc.records import dataclass
from postproc.report.parts.modules import ASSETS, one_script

_NUMBER = re.compile(r"\s*([-+]?[\d.,]+(e[-+]?\d+)?)?\s*([^\s\d]{0,6}\s*)?|-")
"""Cells that are set as numbers: a number with its unit, or what stands for one."""
FINDINGS_HTML = '<div class="scroll" id="findings"></div>'


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


def table(
    head: Sequence[str], rows: Sequence[Sequence[object]], links: Mapping[str, str] | None = None
) -> str:
    """Return an HTML table; every cell is escaped. A click on a head cell sorts it.

    A column with a cell that is no number is set as text. ``links``: addresses of first cells.
    """
    texts = [[str(cell) for cell in row] for row in rows]
    is_text = [not all(_NUMBER.fullmatch(v) for v in c) for c in zip(*texts, strict=True)]
    marks = [' class="text wrap"' if text else "" for text in is_text] or [""] * len(head)
    top = "".join(f"<th{m}>{escape(cell)}</th>" for cell, m in zip(head, marks, strict=True))
    body = ""
    for row in texts:
        cells = [escape(cell) for cell in row]
        if links and row[0] in links:
            cells[0] = f'<a href="{escape(links[row[0]])}">{cells[0]}</a>'
        body += "<tr>" + "".join(f"<td{m}>{c}</td>" for c, m in zip(cells, marks, strict=True))
        body += "</tr>"
    return f'<table class="data"><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>'


def first_rows(
    head: Sequence[str], rows: Sequence[Sequence[object]], left: int, hint: str = ""
) -> str:
    """Return a table that scrolls, with how many rows were left out."""
    more = f"<p>and {left} more{hint}</p>" if left > 0 else ""
    return f'<div class="scroll">{table(head, rows)}</div>{more}'


def finding_rows(
    findings: Sequence[Finding], tag_of: Callable[[Finding], int | None] | None = None
) -> list[list[Any]]:
    """Return findings for the page's scripts; ``tag_of`` tells the row of the page of one."""
    tag_of = tag_of or (lambda finding: finding.tag_index)
    return [[str(i), i.hint or "", str(i.severity), tag_of(i), i.code] for i in findings]


@dataclass(slots=True)
class Page:
    """A page under construction: title, lead sentences, sections of trusted HTML, script, data.

    ``script`` is the module of the assets folder that the page starts; ``good``: whether what the
    page shows is, None where that is no question.
    """

    title: str
    lead: Sequence[str] = ()
    sections: list[str] = field(default_factory=list)
    script: str = "page.js"
    data: dict[str, Any] = field(default_factory=dict)
    good: bool | None = None

    def section(self, heading: str, body: str, width: str = "") -> None:
        """Add a section; ``width`` is "", ``half``, ``third`` or ``wide``; ``body`` is HTML."""
        self.sections.append(f'<section class="{width}"><h2>{escape(heading)}</h2>{body}</section>')

    def findings(
        self, findings: Sequence[Finding], tag_of: Callable[[Finding], int | None] | None = None
    ) -> None:
        """Add the section of findings; a click on one with a tag selects that."""
        self.data["findings"] = finding_rows(findings, tag_of)
        self.section("Findings", FINDINGS_HTML, "half")

    def render(self) -> bytes:
        """Return the page as UTF-8 bytes."""
        style = (ASSETS / "page.css").read_text(encoding="utf-8")
        tone = {None: "lead", True: "lead good", False: "lead bad"}[self.good]
        lead = "".join(
            f'<p class="{tone if i == 0 else ""}">{escape(line)}</p>'
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
