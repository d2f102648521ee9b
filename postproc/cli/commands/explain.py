"""``postproc explain``: cause and remedy of a finding code, meaning of an effect."""

from __future__ import annotations

import textwrap

import click

from postproc.cli import common as cli
from postproc.codes import Entry, groups
from postproc.jobs.explain import explain, explain_document

_WIDTH = 88


@cli.command("""
  postproc explain APT010
  postproc explain pln102 --json
  postproc explain joint_limit
  postproc explain thermal_drift
  postproc explain
""")
@click.argument("code", required=False, shell_complete=cli.complete_explained)
def command(session: cli.Session, /, code: str | None) -> int:
    """Say what a finding CODE means and what to do about it; without CODE list all codes.

    CODE may also be a measure or violation of verify, an effect of a diagnosis, or any word that a
    command prints in front of its figures.
    """
    if code is None:
        listed = [entry for group in groups() for entry in group.entries]
        codes = [{"code": e.code, "severity": e.severity, "title": e.title} for e in listed]
        session.document({"schema": "postproc.explain/1", "codes": codes})
        session.show("\n\n".join(_listing()))
    else:
        entry = explain(code)
        session.document(explain_document(entry))
        session.show(_page(entry))
    return cli.answer(good=True)


def _page(entry: Entry) -> str:
    kind = f" ({entry.severity})" if entry.severity else ""
    parts = [textwrap.fill(f"{entry.code}{kind}: {entry.title}", _WIDTH)]
    for head, text in (("Cause", entry.cause), ("Remedy", entry.remedy)):
        if text:
            parts.append(textwrap.fill(f"{head}: {text}", _WIDTH, subsequent_indent="  "))
    return "\n\n".join(parts)


def _listing() -> list[str]:
    """Return a paragraph per prefix, one line per code."""
    return [
        "\n".join(
            [f"{group.prefix}  {group.about}", *(f"  {e.code}  {e.title}" for e in group.entries)]
        )
        for group in groups()
    ]
