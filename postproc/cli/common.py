"""What all commands share: --json, --quiet, messages on stderr, progress on a terminal."""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Concatenate, ParamSpec, TypeVar

import click

from postproc.errors import ExitCode, Issue

P = ParamSpec("P")
R = TypeVar("R")
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True)
class Session:
    """How this call talks to its caller."""

    json: bool
    quiet: bool

    def document(self, content: dict[str, Any]) -> None:
        """Print the one JSON object of ``--json``; nothing without that option."""
        if self.json:
            click.echo(json.dumps(content, allow_nan=False, ensure_ascii=False, indent=1))

    def say(self, text: str = "") -> None:
        """Tell a person something on stderr, unless ``--quiet``."""
        if not self.quiet:
            click.echo(text, err=True)

    def show(self, text: str) -> None:
        """Print a result for a person on stdout, unless ``--json`` or ``--quiet``."""
        if not (self.json or self.quiet):
            click.echo(text)

    def issues(self, issues: tuple[Issue, ...] | list[Issue], at_most: int = 20) -> None:
        """Print findings, one line each, on stderr."""
        for issue in issues[:at_most]:
            self.say(str(issue))
        if len(issues) > at_most:
            self.say(f"... and {len(issues) - at_most} more")

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """Yield ``report(done, total, what)``; a bar on a terminal, nothing in a pipe."""
        if self.quiet or not sys.stderr.isatty():
            yield lambda done, total, what: None
            return
        from rich.console import Console
        from rich.progress import Progress as Bar

        with Bar(console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task("", total=None)

            def report(done: int, total: int, what: str) -> None:
                bar.update(task, completed=done, total=total, description=what)

            yield report


def standard_options(
    function: Callable[Concatenate[Session, P], R],
) -> Callable[P, R]:
    """Add ``--json`` and ``--quiet`` to a command; it gets a ``Session`` first."""

    @click.option("--json", "as_json", is_flag=True, help="Print one JSON object on stdout.")
    @click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
    @functools.wraps(function)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        as_json = bool(kwargs.pop("as_json"))
        quiet = bool(kwargs.pop("quiet"))
        return function(Session(as_json, quiet), *args, **kwargs)

    return wrapper


def answer(good: bool) -> int:
    """Return the exit code for a good or a bad answer."""
    return ExitCode.GOOD if good else ExitCode.BAD_ANSWER
