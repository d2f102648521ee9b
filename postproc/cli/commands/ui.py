"""``postproc ui``: the pages, alive, on this machine only."""

from __future__ import annotations

import importlib.util
import webbrowser
from pathlib import Path

import click

from postproc.cli import common as cli
from postproc.errors import ExitCode, SourceRef, UsageError

_NEEDED = ("starlette", "uvicorn")


@cli.command("""
  postproc ui cell.toml panel.csv
  postproc ui cell.toml
  postproc ui cell.toml panel.csv --port 8800 --no-browser
""")
@click.argument("cell", metavar="CELL.toml")
@click.argument("source", metavar="[INPUT]", required=False)
@cli.option(
    "--port", "Default: a free one.", click.IntRange(0, 65535), default=0, show_default=False
)
@cli.option("--no-browser", "Only print the address.")
def command(
    session: cli.Session, /, cell: str, source: str | None, port: int, no_browser: bool
) -> int:
    """Open a workbench: see a job, pin spins, move the part, save what CONVERT takes.

    It listens at 127.0.0.1 only, behind a random token in the address; nothing leaves the
    machine. Ctrl-C ends it.
    """
    if any(importlib.util.find_spec(name) is None for name in _NEEDED):
        text = 'the workbench needs an extra: pip install "postproc[ui]"'
        raise UsageError("PLG008", text, SourceRef("postproc"))
    from postproc.workbench import open_workbench

    def tell(address: str) -> None:
        session.document({"schema": "postproc.ui/1", "address": address})
        session.show(f"workbench  {address}")
        session.say("Ctrl-C ends it")
        if not no_browser:
            webbrowser.open(address)

    open_workbench(Path(cell), Path(source) if source else None, port, tell)
    return ExitCode.GOOD
