"""Read KRL modules: whatever post has written them.

Files that cannot be KRL at all raise one ``KrlError``. Inside a file the reader goes on after a
line that is no KRL: the line is kept as ``Raw`` and stands in ``KrlModule.problems``, so that lint
can list all of them; ``require_sound`` turns the first into an error for those who must run the
program.

Codes: KRL001 not text, KRL002 empty, KRL003 too large, KRL004 a line is no KRL, KRL005 no routine
or data list in the file, KRL006 an unclosed routine, KRL007 a module without .src.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path, PurePath

from postproc.errors import Finding, KrlError, ReadError, Severity, SourceRef
from postproc.files import read_bytes
from postproc.krl.text import program as krl
from postproc.krl.text.lexer import KrlSyntaxError, split_comment
from postproc.krl.text.motion_statements import plain_move
from postproc.krl.text.source import TextFacts, check_size, decode
from postproc.krl.text.statements import parse_statement
from postproc.records import dataclass

_DEF = re.compile(
    r"(GLOBAL\s+)?(?:DEF|DEFFCT\s+([A-Za-z_]\w*(?:\s*\[[^\]]*\])?))\s+"
    r"([$A-Za-z_]\w*)\s*\(([^)]*)\)$",
    re.ASCII | re.IGNORECASE,
)
_DEFDAT = re.compile(
    r"DEFDAT\s+([$A-Za-z_][$\w]*)(?:\s*\(\s*\))?(?:\s+(PUBLIC))?$", re.ASCII | re.IGNORECASE
)
_OPENING = re.compile(r"(?:GLOBAL\s+)?(DEF|DEFFCT|DEFDAT)\b", re.IGNORECASE)
_PARAMETER = re.compile(
    r"([A-Za-z_]\w*)\s*(\[[^\]]*\])?\s*(?::\s*(IN|OUT))?$", re.ASCII | re.IGNORECASE
)
_BETWEEN_PARAMETERS = re.compile(r",(?![^\[]*\])")
_OF_MOVES = frozenset(" \tPLS")
"""With these a line of a plain motion begins."""
_ENDINGS = frozenset({"END", "ENDFCT", "ENDDAT"})
_PROBLEMS_AT_MOST = 1000


@dataclass(slots=True)
class _Part:
    """One file while it is read; ``open`` is the routine or data list that lines belong to."""

    path: str
    facts: TextFacts
    attributes: list[str] = field(default_factory=list)
    before: list[krl.Statement] = field(default_factory=list)
    blocks: list[krl.Routine | krl.DataList] = field(default_factory=list)
    problems: list[Finding] = field(default_factory=list)

    def problem(self, line: int, text: str, message: str, code: str = "KRL004") -> None:
        """Note a line that is no KRL."""
        if len(self.problems) < _PROBLEMS_AT_MOST:
            place = SourceRef(self.path, line, text)
            self.problems.append(Finding(Severity.ERROR, code, message, source=place))


# ------------------------------------------------------------------------------ public entrances


def parse_files(files: Mapping[str, bytes]) -> tuple[krl.KrlModule, ...]:
    """Return the modules of files by name, in the order of their first file.

    ``NAME.src`` and ``NAME.dat`` make a module, in any case. Files of other kinds are left out.
    """
    pairs: dict[str, dict[str, str]] = {}
    for path in files:
        pure = PurePath(path)
        kind = pure.suffix.lower()
        if kind in (".src", ".dat", ".sub"):
            stem = str(pure.with_suffix("")).upper()
            pairs.setdefault(stem, {})["src" if kind == ".sub" else kind[1:]] = path
    modules = []
    for pair in pairs.values():
        src = _read(files[pair["src"]], pair["src"]) if "src" in pair else None
        dat = _read(files[pair["dat"]], pair["dat"]) if "dat" in pair else None
        modules.append(_module(src, dat))
    return tuple(modules)


def parse_module(path: str | Path) -> krl.KrlModule:
    """Read a module from disk: the file and its partner (.src or .dat) beside it."""
    return parse_files({name: _content(name) for name in with_partners([str(path)])})[0]


def load_modules(
    paths: Sequence[str | Path], bad: list[Finding] | None = None
) -> tuple[krl.KrlModule, ...]:
    """Read modules from files (each with its partner) and folders (all modules within).

    ``bad`` gets a finding for each file that cannot be read, instead of an error.
    """
    found: list[str] = []
    for path in paths:
        found += _in_folder(Path(path)) if Path(path).is_dir() else [str(path)]
    if bad is None:
        return parse_files({name: _content(name) for name in with_partners(found)})
    good = {}
    for name in with_partners(found):
        try:
            good[name] = _content(name)
            _read(good[name], name)
        except (KrlError, ReadError) as problem:
            good.pop(name, None)
            place = problem.source or SourceRef(name)
            bad.append(Finding(Severity.ERROR, problem.code, problem.message, source=place))
    return parse_files(good)


def require_sound(modules: Sequence[krl.KrlModule]) -> None:
    """Refuse modules that a controller could not even load."""
    for module in modules:
        if module.problems:
            first = module.problems[0]
            raise KrlError(first.code, first.message, first.source)
        blocks: list[krl.Routine | krl.DataList] = [*module.routines]
        if module.data is not None:
            blocks.append(module.data)
        for block in blocks:
            if not block.is_closed:
                path = module.dat_path if isinstance(block, krl.DataList) else module.src_path
                text = f"{block.name} has no end, expected END or ENDDAT: the file is cut off"
                raise KrlError("KRL006", text, SourceRef(path, block.end_line))


def with_partners(paths: Sequence[str]) -> list[str]:
    """Return the paths, each followed by its .dat or .src beside it where there is one."""
    found: dict[str, None] = {}
    for path in paths:
        found[path] = None
        pure = Path(path)
        for other in (".src", ".dat") if pure.suffix.lower() in (".src", ".dat") else ():
            if pure.suffix.lower() != other:
                partner = _beside(pure, other)
                if partner is not None:
                    found[partner] = None
    return list(found)


def _beside(path: Path, suffix: str) -> str | None:
    for candidate in (path.with_suffix(suffix), path.with_suffix(suffix.upper())):
        if candidate.is_file():
            return str(candidate)
    return None


def _in_folder(folder: Path) -> list[str]:
    found = sorted(
        str(path)
        for path in folder.rglob("*")
        if path.suffix.lower() in (".src", ".dat", ".sub") and path.is_file()
    )
    if not found:
        raise KrlError("KRL007", "no .src and no .dat in this folder", SourceRef(str(folder)))
    return found


def _content(path: str) -> bytes:
    if PurePath(path).suffix.lower() not in (".src", ".dat", ".sub"):
        raise KrlError("KRL007", "expected a .src or .dat file, or a folder", SourceRef(path))
    if Path(path).is_file():
        check_size(Path(path).stat().st_size, path)
    return read_bytes(path)


# --------------------------------------------------------------------------------------- modules


def _module(src: _Part | None, dat: _Part | None) -> krl.KrlModule:
    routines = tuple(b for b in src.blocks if isinstance(b, krl.Routine)) if src else ()
    lists = [b for b in dat.blocks if isinstance(b, krl.DataList)] if dat else []
    problems = (src.problems if src else []) + (dat.problems if dat else [])
    path = src.path if src else dat.path if dat else ""
    return krl.KrlModule(
        name=PurePath(path).stem,
        routines=routines,
        data=lists[0] if lists else None,
        attributes=tuple(src.attributes) if src else (),
        before=tuple(src.before) if src else (),
        src_path=src.path if src else "",
        dat_path=dat.path if dat else "",
        problems=tuple(problems),
        src_facts=src.facts if src else None,
        dat_facts=dat.facts if dat else None,
    )


def _read(data: bytes, path: str) -> _Part:
    lines, facts = decode(data, path)
    part = _Part(path, facts)
    _Reader(part).run(lines)
    wanted = krl.DataList if path.lower().endswith(".dat") else krl.Routine
    if not any(isinstance(block, wanted) for block in part.blocks):
        first = part.problems[0].source if part.problems else None
        what = "DEFDAT" if wanted is krl.DataList else "DEF"
        text = f"no {what} line in the file, expected a KRL module"
        raise KrlError("KRL005", text, first or SourceRef(path))
    return part


class _Reader:
    """Walks over the lines of a file and cuts it into routines."""

    def __init__(self, part: _Part) -> None:
        self.part = part
        self.head: dict[str, object] | None = None
        self.kind: type[krl.Routine] | type[krl.DataList] = krl.Routine
        self.body: list[krl.Statement] = []
        self.loose: list[krl.Statement] = []
        """Comments and empty lines outside of routines."""

    def run(self, lines: list[str]) -> None:
        for number, raw in enumerate(lines, 1):
            if self.head is not None and raw[:1] in _OF_MOVES:
                move = plain_move(raw, number)
                if move is not None:
                    self.body.append(move)
                    continue
            text = raw.strip()
            if not text:
                self._put(krl.Blank(line=number))
            elif text[0] == ";":
                self._put(_comment(raw.lstrip(), number))
            elif text[0] == "&":
                self._attribute(text, number)
            else:
                self._code(raw, text, number)
        if self.head is not None:
            self._close(len(lines), is_closed=False, comment="")
        self._flush_loose()

    def _put(self, statement: krl.Statement) -> None:
        (self.loose if self.head is None else self.body).append(statement)

    def _attribute(self, text: str, number: int) -> None:
        if self.head is not None or self.part.blocks:
            self.part.problem(number, text, "a header line (&) behind the first routine")
        self.part.attributes.append(text[1:])

    def _code(self, raw: str, text: str, number: int) -> None:
        code, comment = split_comment(raw)
        code = code.strip()
        # Most lines are motions or declarations: only lines with these letters can open or close.
        first = code[:1]
        if first in "DdGg" and _OPENING.match(code):
            self._open(code, comment, number)
        elif first in "Ee" and code.upper() in _ENDINGS:
            self._end(code.upper(), comment, number)
        elif self.head is None:
            self.part.problem(number, text, f"{code[:40]!r} stands outside of any routine")
        else:
            try:
                self.body.append(parse_statement(code, comment, number))
            except KrlSyntaxError as fault:
                self.part.problem(number, text, str(fault))
                self.body.append(krl.Raw(text=code, comment=comment, line=number))

    def _open(self, code: str, comment: str, number: int) -> None:
        if self.head is not None:
            self._close(number - 1, is_closed=False, comment="")
        self._flush_loose()
        routine, data = _DEF.match(code), _DEFDAT.match(code)
        if data:
            self.kind = krl.DataList
            self.head = {"name": data.group(1), "is_public": bool(data.group(2))}
        else:
            self.kind = krl.Routine
            self.head = self._routine_head(routine, code, number)
        self.head |= {"comment": comment, "line": number}

    def _routine_head(
        self, match: re.Match[str] | None, code: str, number: int
    ) -> dict[str, object]:
        if match is None:
            words = re.split(r"[\s(]+", code)
            name = words[1] if len(words) > 1 else ""
            self.part.problem(number, code, f"{code[:40]!r}: expected DEF name( )")
            return {"name": name, "parameters": ()}
        head: dict[str, object] = {
            "name": match.group(3),
            "is_global": bool(match.group(1)),
            "result_type": match.group(2),
        }
        head["parameters"] = self._parameters(match.group(4), code, number)
        return head

    def _parameters(self, text: str, code: str, number: int) -> tuple[krl.Parameter, ...]:
        found = []
        for item in _BETWEEN_PARAMETERS.split(text) if text.strip() else ():
            match = _PARAMETER.match(item.strip())
            if match is None:
                self.part.problem(number, code, f"{item.strip()!r} is no parameter")
                continue
            dimension = match.group(2)
            found.append(
                krl.Parameter(
                    match.group(1),
                    (match.group(3) or "").upper(),
                    dimension[1:-1].strip() if dimension is not None else None,
                )
            )
        return tuple(found)

    def _end(self, word: str, comment: str, number: int) -> None:
        if self.head is None:
            self.part.problem(number, word, f"{word} without a routine before it")
            return
        right = {"END"} if self.kind is krl.Routine else {"ENDDAT"}
        if self.head.get("result_type"):
            right = {"ENDFCT"}
        if word not in right:
            self.part.problem(number, word, f"{word} closes what {right.pop()} should close")
        self._close(number, is_closed=True, comment=comment)

    def _close(self, number: int, *, is_closed: bool, comment: str) -> None:
        assert self.head is not None  # noqa: S101 - callers have asked
        self.head |= {"is_closed": is_closed, "end_line": number}
        statements = tuple(self.body)
        if self.kind is krl.DataList:
            self.head |= {
                "attributes": tuple(self.part.attributes),
                "before": tuple(self.part.before),
            }
        self.part.blocks.append(self.kind(statements=statements, **self.head))  # type: ignore[arg-type]
        self.head, self.body = None, []

    def _flush_loose(self) -> None:
        """Give comments between routines to the routine before, those in front to the file."""
        if self.part.blocks and self.loose:
            last = self.part.blocks[-1]
            if isinstance(last, krl.Routine):
                self.part.blocks[-1] = replace(last, after=tuple(self.loose))
        elif self.loose:
            self.part.before += self.loose
        self.loose = []


def _comment(text: str, number: int) -> krl.Statement:
    upper = text[:9].upper()
    if upper.startswith(";FOLD") and text[5:6] in ("", " ", "\t"):
        return krl.FoldBegin(text=text[6:], line=number)
    if upper.startswith(";ENDFOLD"):
        return krl.FoldEnd(text=text[8:].strip(), line=number)
    return krl.Comment(text=text[1:], line=number)
