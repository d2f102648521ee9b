"""Frame texts from templates: Jinja2 in a sandbox, the cell's own folder before the built-in one.

Text that comes from outside (the CAM file, names) never passes through a template: a template sees
an opaque mark that prints as a comment. Its output is read by the KRL reader, a line that is no KRL
is refused, and only then the marks, which may stand in comments and nowhere else, are replaced by
the escaped text.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from postproc import krl
from postproc.errors import EmitError, SourceRef
from postproc.files import shown_from
from postproc.records import dataclass
from postproc.resources import templates_folder

if TYPE_CHECKING:
    from jinja2.sandbox import SandboxedEnvironment

LINE_LENGTH = 250
"""Longest line of a template's output."""
LINES_AT_MOST = 10_000
"""Most lines a template may give."""
_FILTERS = ("abs", "default", "d", "float", "int", "length", "round")
_MARK = "@{}@"
_VALUE = re.compile(r"\{\{.*?\}\}|\{%.*?%\}|\{#.*?#\}")
"""What a template puts into its text."""


class OutsideText:
    """A mark for outside text: prints as a comment, is true when there is a text, nothing else."""

    __slots__ = ("_comment",)

    def __init__(self, key: str, text: str) -> None:
        self._comment = f"; {_MARK.format(key)}" if text else ""

    def __str__(self) -> str:
        """Return the mark as a comment."""
        return self._comment

    def __bool__(self) -> bool:
        """Return whether there is a text."""
        return bool(self._comment)


@dataclass(frozen=True)
class TemplateSet:
    """The templates of a cell: a built-in set or a folder; ``source``: for errors."""

    template: str
    source: SourceRef

    def lines(self, name: str, values: Mapping[str, object]) -> list[str]:
        """Return the lines of template ``name`` (without ``.j2``), without empty ones."""
        from jinja2 import TemplateError

        try:
            text = self._environment.get_template(f"{name}.j2").render(values)
        except (TemplateError, TypeError, ValueError, ArithmeticError, RecursionError) as problem:
            reason = " ".join(str(problem).split()) or type(problem).__name__
            number = getattr(problem, "lineno", None) or 1
            where = self.file(getattr(problem, "name", None) or name, number)
            raise EmitError("EMT331", f"template: {reason}", where) from problem
        lines = [line.strip() for line in text.split("\n") if line.strip()]
        self._check(name, lines)
        return lines

    def statements(
        self, name: str, values: Mapping[str, object], texts: Mapping[str, str] | None = None
    ) -> list[krl.Statement]:
        """Return the statements of template ``name``; of outside ``texts`` it sees marks only."""
        outside = texts or {}
        key = (name, repr(sorted(values.items())), tuple((k, bool(t)) for k, t in outside.items()))
        if key not in self._read:
            marks = {k: OutsideText(k, t) for k, t in outside.items()}
            lines = self.lines(name, {**values, **marks})
            module = self._module(name, ["DEF T( )", *lines, "END"])
            if len(module.routines) != 1:
                message = f"template {name} begins a routine, expected statements only"
                raise EmitError("EMT333", message, self.file(name))
            found = [s for s in module.main.statements if not isinstance(s, krl.Blank)]
            moves = next((krl.render_statement(s) for s in found if isinstance(s, krl.Move)), None)
            if moves is not None:
                text = f"template {name} moves the arm: {moves.strip()[:60]!r}, expected no motion"
                raise EmitError("EMT333", text, self.file(name))
            self._read[key] = found
        return [_filled(statement, name, outside) for statement in self._read[key]]

    def module(self, name: str, values: Mapping[str, object], module_name: str) -> krl.KrlModule:
        """Return a template that is a whole module text; errors as ``statements``."""
        module = self._module(name, self.lines(name, values))
        return replace(module, name=module_name, src_path="", src_facts=None)

    def _module(self, name: str, lines: list[str]) -> krl.KrlModule:
        text = "\r\n".join([*lines, ""]).encode("ascii")
        module = krl.parse_files({f"{name}.src": text})[0]
        if module.problems:
            problem = module.problems[0]
            line = problem.source.text if problem.source else ""
            message = f"template {name} gives {line[:80]!r}: {problem.message}"
            raise EmitError("EMT333", message, self.file(name))
        return module

    def _check(self, name: str, lines: list[str]) -> None:
        if len(lines) > LINES_AT_MOST:
            raise EmitError("EMT332", f"template {name} gives {len(lines)} lines", self.source)
        for line in lines:
            if len(line) > LINE_LENGTH or not (line.isascii() and line.isprintable()):
                text = (
                    f"template {name} gives the line {line[:60]!r}, expected at most "
                    f"{LINE_LENGTH} printable ASCII characters"
                )
                raise EmitError("EMT332", text, self.file(name))

    @property
    def own(self) -> Path | None:
        """The folder of the cell's own templates, None where it has none."""
        return self._folders[0] if self._folders[0].parent != templates_folder() else None

    def origin(self, line: str) -> SourceRef | None:
        """Return the line of the cell's own templates that gives a line of a program, if one does.

        Values that a template puts in may be anything; blanks do not count. Of several such lines
        the one with the most text of its own is meant.
        """
        wanted = "".join(line.split()).upper()
        most, found = 0, None
        for path in sorted(self.own.glob("*.j2")) if self.own else ():
            rows = path.read_text("utf-8", "replace").splitlines()
            for number, row in enumerate(rows, start=1):
                fixed = ["".join(part.split()).upper() for part in _VALUE.split(row)]
                pattern, size = ".*".join(re.escape(part) for part in fixed), sum(map(len, fixed))
                if size > most and re.fullmatch(pattern, wanted):
                    most, found = size, self.file(path.name, number, row.strip())
        return found

    def file(self, name: str, line: int = 1, text: str = "") -> SourceRef:
        """Return a line of a template, its file named from where the cell file was named."""
        name = f"{name.removesuffix('.j2')}.j2"
        folder = next((one for one in self._folders if (one / name).is_file()), self._folders[-1])
        return SourceRef(shown_from(self.source.path, folder / name), line, text)

    @cached_property
    def _read(self) -> dict[object, list[krl.Statement]]:
        return {}

    @cached_property
    def _folders(self) -> tuple[Path, ...]:
        """Folders that are searched, in order."""
        builtin = templates_folder()
        default = builtin / "default"
        is_name = Path(self.template).name == self.template
        own = builtin / self.template if is_name else Path(self.template)
        if not own.is_dir():
            known = ", ".join(sorted(p.name for p in builtin.iterdir() if p.is_dir()))
            text = f"no template folder {self.template!r}, built-in is {known}"
            raise EmitError("EMT330", text, self.source)
        return (default,) if own == default else (own, default)

    @cached_property
    def _environment(self) -> SandboxedEnvironment:
        return _environment_of(self._folders)


def _filled(statement: krl.Statement, name: str, texts: Mapping[str, str]) -> krl.Statement:
    """Return the statement with the marks in its comment replaced, and without a line number."""
    comment = _replaced(statement.comment, texts)
    changes: dict[str, Any] = {"comment": comment, "line": 0}
    if isinstance(statement, krl.Comment | krl.FoldBegin):
        changes["text"] = _replaced(statement.text, texts)
    elif "@" in krl.render_statement(replace(statement, comment="")):
        raise EmitError("EMT334", f"template {name} puts CAM text outside a comment")
    return replace(statement, **changes)


def _replaced(text: str, texts: Mapping[str, str]) -> str:
    """Return the text with its marks replaced, in one go: a replacement is not looked at again."""
    if "@" not in text:
        return text
    pieces = text.split("@")
    for position in range(1, len(pieces)):
        key = pieces[position]
        if key in texts and position < len(pieces) - 1:
            before, after = "@".join(pieces[:position]), "@".join(pieces[position + 1 :])
            return f"{before}{krl.comment_text(texts[key])}{_replaced(after, texts)}"
    return text


def _printed(value: object) -> object:
    """Return a value as it is printed: numbers as KRL."""
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    return krl.numbers.real(value) if isinstance(value, float) else value


@lru_cache(maxsize=8)
def _environment_of(folders: tuple[Path, ...]) -> SandboxedEnvironment:
    """Return the templates of some folders; a template is read again when its file changes."""
    from jinja2 import FileSystemLoader, StrictUndefined
    from jinja2.sandbox import ImmutableSandboxedEnvironment

    class Environment(ImmutableSandboxedEnvironment):
        """No attributes of marks, no powers, no products of texts."""

        intercepted_binops = frozenset({"*", "**", "%"})

        def is_safe_attribute(self, obj: object, attr: str, value: object) -> bool:
            hidden = isinstance(obj, OutsideText | str)
            return not hidden and super().is_safe_attribute(obj, attr, value)

        def call_binop(self, context: Any, operator: str, left: Any, right: Any) -> Any:  # noqa: ANN401
            is_number = isinstance(left, int | float) and isinstance(right, int | float)
            if operator == "**" or not is_number:
                raise TypeError(f"operator {operator} is not for templates")
            return super().call_binop(context, operator, left, right)

    environment = Environment(
        loader=FileSystemLoader([str(folder) for folder in folders]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
        finalize=_printed,
    )
    environment.filters = {name: environment.filters[name] for name in _FILTERS}
    environment.globals.clear()
    return environment
