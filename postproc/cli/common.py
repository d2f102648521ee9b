"""What all commands share: --json, --quiet, messages on stderr, progress on a terminal."""

from __future__ import annotations

import functools
import importlib
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import click
from click.shell_completion import CompletionItem

from postproc.errors import ExitCode, Finding, Severity, fold
from postproc.progress import Progress
from postproc.records import dataclass

if TYPE_CHECKING:
    from postproc.cell import Cell
    from postproc.model import ToolPath
    from postproc.registry import Registry

_SHOWN = {Severity.ERROR: 5, Severity.WARNING: 3, Severity.NOTE: 3}
_MOST_RANGES = 12


class _Finite(click.ParamType):  # type: ignore[type-arg]
    """A number to reckon with: ``nan`` is in every range, and below no tolerance."""

    def convert(
        self,
        value: Any,  # noqa: ANN401 - click's own signature
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> float:
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return number


class Number(_Finite, click.types.FloatParamType):
    """A finite number of any size, as an option or an answer."""


class NumberRange(_Finite, click.FloatRange):
    """A finite number in a range."""


NUMBER = Number()
POSITIVE = NumberRange(min=0.0, min_open=True)
NOT_NEGATIVE = NumberRange(min=0.0)

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]
P = ParamSpec("P")
R = TypeVar("R")


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

    def error(self, text: str) -> None:
        """Print an error on stderr, also with ``--quiet``."""
        click.echo(text, err=True)

    def show(self, text: str) -> None:
        """Print a result for a person on stdout, unless ``--json`` or ``--quiet``."""
        if not (self.json or self.quiet):
            click.echo(text)

    def table(self, head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Print a table on stdout: ruled on a terminal, aligned plain text in a pipe.

        A column whose cells are all numbers is aligned to the right.
        """
        if self.json or self.quiet:
            return
        cells = [[str(cell) for cell in row] for row in rows]
        right = [all(_is_number(row[k]) for row in cells) for k in range(len(head))]
        if sys.stdout.isatty():
            _ruled(head, cells, right)
            return
        for line in _aligned(head, cells, right):
            click.echo(line)

    def findings(self, findings: Iterable[Finding]) -> None:
        """Print findings on stderr, errors first, what would help on a following line.

        Of one code at most ``_SHOWN`` are printed, the others counted with their lines, so that
        many equal warnings hide nothing. With ``--quiet`` errors only.
        """
        groups: dict[tuple[Severity, str], list[Finding]] = {}
        for finding in fold(findings):
            groups.setdefault((finding.severity, finding.code), []).append(finding)
        for (severity, code), group in groups.items():
            if self.quiet and severity is not Severity.ERROR:
                continue
            most, lines = _SHOWN[severity], []
            for finding in group[:most]:
                lines.append(_coloured(str(finding), str(severity)))
                lines += [f"    hint: {finding.hint}"] if finding.hint else []
            if len(group) > most:
                lines.append(f"... and {len(group) - most} more of {code}{_lines(group[most:])}")
            click.echo("\n".join(lines), err=True)

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
                bar.update(task, completed=done, total=total or None, description=what)

            yield report


def _lines(findings: Sequence[Finding]) -> str:
    """Return the lines that findings are about, in brackets; nothing where they have none."""
    lines = sorted({finding.source.line for finding in findings if finding.source})
    if not lines:
        return ""
    ranges: list[list[int]] = []
    for line in lines:
        if ranges and line == ranges[-1][1] + 1:
            ranges[-1][1] = line
        else:
            ranges.append([line, line])
    shown = ", ".join(f"{a}-{b}" if b > a else f"{a}" for a, b in ranges[:_MOST_RANGES])
    return f" (lines {shown}{', ...' if len(ranges) > _MOST_RANGES else ''})"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text in ("", "-", "?")
    return True


def _aligned(
    head: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[bool]
) -> Iterator[str]:
    widths = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head))]
    for row in (head, *rows):
        parts = [
            cell.rjust(width) if is_right else cell.ljust(width)
            for cell, width, is_right in zip(row, widths, right, strict=True)
        ]
        yield "  ".join(parts).rstrip()


def _ruled(head: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[bool]) -> None:
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD)
    for name, is_right in zip(head, right, strict=True):
        table.add_column(name, justify="right" if is_right else "left")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    Console().print(table)


_COLOURS = {"error": "red", "warning": "yellow", "note": "cyan"}


def _coloured(line: str, severity: str) -> str:
    """Return a finding with its severity in colour, on a terminal without NO_COLOR."""
    if not sys.stderr.isatty() or os.environ.get("NO_COLOR") or severity not in _COLOURS:
        return line
    return line.replace(severity, click.style(severity, fg=_COLOURS[severity]), 1)


class Part(click.ParamType):  # type: ignore[type-arg]
    """A part that can be plugged in, by its name in a registry of a room, or one of ``more``.

    The registry is loaded only for a call that names a part: help stays fast. It is not checked
    where the job says itself which parts there are.
    """

    name = "text"

    def __init__(self, room: str, registry: str, *more: str, is_checked: bool = True) -> None:
        self._room, self._registry, self._more = room, registry, more
        self._is_checked = is_checked

    def convert(
        self,
        value: Any,  # noqa: ANN401 - click's own signature
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> str:
        """Return the name, if a part has it."""
        if self._is_checked and value not in self._more:
            parts = _parts(self._room, self._registry)
            if value not in parts:
                self.fail(parts.unknown(value, *self._more), param, ctx)
        return str(value)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return the parts whose names begin so."""
        names = [*self._more, *(name for name, _ in _parts(self._room, self._registry))]
        return [CompletionItem(name) for name in _beginning(names, incomplete)]


_PLUGGED = {
    "format": Part("postproc.readers", "READERS", "auto"),
    "emitter": Part("postproc.emitters", "EMITTERS"),
    "objective": Part("postproc.planning", "OBJECTIVES", is_checked=False),
}
"""Options that name a part which can be plugged in."""


def option(usage: str, text: str = "", kind: Any = None, **more: Any) -> Decorator:  # noqa: ANN401 - as of click
    """Return an option of a command.

    Args:
        usage: names and value as the help shows them, ``-o, --output DIR``; without a value, a
            kind and a default it is a flag.
        text: for the help; a default is shown behind it.
        kind: a type of click, or the words that it takes.
        more: as of ``click.option``.
    """
    words = usage.split()
    names = [word.rstrip(",") for word in words if word[0] == "-"]
    values = words[len(names) :]
    if len(values) > 1:
        more = {"nargs": len(values), **more}
    if not (values or kind or "default" in more):
        more = {"is_flag": True, **more}
    told = {"metavar": " ".join(values) or None, "help": text, "show_default": True}
    kind = click.Choice(kind) if isinstance(kind, tuple) else kind
    return click.option(*names, type=kind, **{**told, **more})


CELL = option("--cell CELL.toml", "The robot cell.", required=True)
TOOL = option("--tool N", "TOOL number of a cell with several: on the flange.", int)


def _of_cell(names: Iterable[str]) -> list[Decorator]:
    """Return the options of a call that stand for keys of the cell: said there, once for all."""
    from postproc.cell import CALL_KEYS, key_said

    found: list[Decorator] = []
    for name in names:
        table, options = CALL_KEYS[name]
        meaning, words = key_said(options, name)
        text = f"As [{table}] {name} of the cell: {meaning}."
        kind = words or _PLUGGED.get(name)
        value = "" if kind else " W1,W2" if name == "accept_words" else " TEXT"
        found.append(option(f"--{name.replace('_', '-')}{value}", text, kind))
    return found


def _all(function: Callable[P, R], options: Sequence[Decorator]) -> Callable[P, R]:
    for option in reversed(options):
        function = option(function)
    return function


def reading_options(function: Callable[P, R]) -> Callable[P, R]:
    """Add what says how a CAM file is to be read, alike in all commands that read one."""
    from postproc.cell import Reading

    recover = option("--recover", "Fix faults that have one possible meaning.")
    return _all(function, [*_of_cell(Reading.__annotations__), recover])


def planning_options(function: Callable[P, R]) -> Callable[P, R]:
    """Add what says how programs are planned and written, alike for one and for many inputs."""
    from postproc.cell import CALL_KEYS, Reading

    options = [
        *_of_cell(name for name in CALL_KEYS if name not in Reading.__annotations__),
        option("--model MODEL.toml", "Compensate what this model predicts."),
        option(
            "--keep OLD",
            "Keep the poses of this program (or folder, or manifest) that are still good and "
            "lose little.",
        ),
    ]
    return _all(function, options)


def reading(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return those of a command's options that ``reading_options`` added."""
    from postproc.cell import Reading

    return {name: options[name] for name in (*Reading.__annotations__, "recover")}


def requested(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a ``ConvertRequest`` that a command's options give."""
    from postproc.cell import call_keys
    from postproc.jobs.convert import ConvertRequest

    return {**given(ConvertRequest, options), "keys": call_keys(options)}


def given(kind: type, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return those of a command's options that fields of a dataclass are named after."""
    return {name: options[name] for name in kind.__annotations__ if name in options}


def read_cam(source: str, options: Mapping[str, Any], cell: Cell) -> ToolPath:
    """Read a CAM file as ``reading_options`` say."""
    from postproc.jobs.given import read

    return read(source, cell, **reading(options))


def command(
    examples: str, kind: type[click.Command] = click.Command
) -> Callable[[Callable[..., int]], click.Command]:
    """Return what makes a command with ``--json`` and ``--quiet``: it gets a ``Session`` first."""

    def made(function: Callable[..., int]) -> click.Command:
        @functools.wraps(function)
        def called(json: bool, quiet: bool, **options: Any) -> int:  # noqa: ANN401 - click's own
            context = click.get_current_context()
            for parameter in context.command.params:
                value = options.get(str(parameter.name))
                is_empty = "" in (value if isinstance(value, tuple) else (value,))
                if is_empty and parameter.default != "":
                    raise click.BadParameter("empty, as of an unset variable", context, parameter)
            return function(Session(json, quiet), **options)

        result = click.command(cls=kind, epilog=f"\b\nExamples:{examples}")(called)
        option("--json", "Print one JSON object on stdout.")(result)
        option("-q, --quiet", "Print errors only.")(result)
        return result

    return made


def answer(good: bool) -> int:
    """Return the exit code for a good or a bad answer."""
    return ExitCode.GOOD if good else ExitCode.BAD_ANSWER


def complete_robots(
    context: click.Context, parameter: click.Parameter, incomplete: str
) -> list[str]:
    """Return the built-in robots whose name begins so."""
    from postproc.cell import robot_names

    return _beginning(robot_names(), incomplete)


def complete_explained(
    context: click.Context, parameter: click.Parameter, incomplete: str
) -> list[str]:
    """Return the finding codes and effects that begin so, codes in any case."""
    from postproc.codes import groups

    codes = [entry.code for group in groups() for entry in group.entries]
    effects = [name for name, _ in _parts("postproc.gap", "EFFECTS")]
    found = _beginning(codes, incomplete.upper()) + _beginning(codes, incomplete)
    return list(dict.fromkeys([*found, *_beginning(effects, incomplete)]))


def _parts(room: str, registry: str) -> Registry[Any]:
    parts: Registry[Any] = getattr(importlib.import_module(room), registry)
    return parts


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
