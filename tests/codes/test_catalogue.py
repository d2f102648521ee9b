"""The catalogue and the source agree: each code is raised, explained, and means one thing."""

import ast
import re
import tomllib
from collections import defaultdict
from pathlib import Path

import pytest

import postproc
from postproc.codes import find, groups, nearest
from postproc.errors import RunKind

PACKAGE = Path(postproc.__file__).parent
CODE = re.compile(r"[A-Z]{2,3}\d{3}\Z")
IN_TEXT = re.compile(r"\b(error|warning|note) ([A-Z]{2,3}\d{3})\b")
BUILT = re.compile(r"[A-Z]{2,3}\d?\Z")
LINT, REASON = "KRL1", "PLN"
"""Beginnings of codes that are put together: a row of lint, a reason why a tag fails."""
ENTRIES = [entry for group in groups() for entry in group.entries]
PLANNED = {"severity", "title", "cause", "remedy", "modules"}


class Source:
    """Every code that the source of the package can raise, with modules and severities."""

    def __init__(self, folder):
        self.modules = defaultdict(set)
        self.severities = defaultdict(set)
        self.built = set()
        self.kinds = set()
        for path in sorted(folder.rglob("*.py")):
            self._read(path.relative_to(folder).as_posix(), ast.parse(path.read_text("utf-8")))

    def _read(self, name, tree):
        parents = {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                self._literal(name, node, parents)
            elif isinstance(node, ast.Attribute) and ast.unparse(node.value) == "RunKind":
                self._kind(str(RunKind[node.attr]), node, parents)
            elif isinstance(node, ast.JoinedStr) and len(node.values) == 2:
                first = node.values[0]
                if isinstance(first, ast.Constant) and BUILT.match(first.value):
                    self.built.add(first.value)
            elif isinstance(node, ast.ClassDef) and node.name == "Reason":
                for reason in ast.walk(node):
                    if isinstance(reason, ast.Constant) and isinstance(reason.value, int):
                        self._note(f"{REASON}{reason.value}", None, "error", reason.value > 0)
            elif isinstance(node, ast.Call) and "krl/rules/" in name:
                self._lint(node, tree)

    def _note(self, code, module, severity, wanted=True):
        if wanted:
            self.modules[code] |= {module} - {None}
            self.severities[code].add(severity)

    def _literal(self, module, node, parents):
        if isinstance(parents[node], ast.Expr):
            return  # a docstring
        for severity, code in IN_TEXT.findall(node.value):
            self._note(code, module, severity)
        if CODE.match(node.value):
            parent = parents[node]
            while isinstance(parent, ast.IfExp | ast.keyword):
                parent = parents[parent]
            if isinstance(parent, ast.Call | ast.arguments):
                for severity in severities_of(parent):
                    self._note(node.value, module, severity)

    def _kind(self, kind, node, parents):
        """Take ``finding(RunKind.FRAME, ...)``: an error unless it is given another severity."""
        call = parents[node]
        if isinstance(call, ast.Call):
            given = re.findall(r"Severity\.([A-Z]+)|\bseverity\b", ast.unparse(call))
            self.severities[kind] |= {severity.lower() or None for severity in given or ["ERROR"]}
        self.kinds.add(kind)

    def _lint(self, call, tree):
        """Take ``subject.add(row, severity, ...)`` and ``part.error(row, ...)``, ``part.warn``.

        A row that is a name has the numbers set.
        """
        name = call.func.attr if isinstance(call.func, ast.Attribute) else ""
        if name not in ("add", "error", "warn") or len(call.args) < 3:
            return  # add of two: that of a set
        row, severity = call.args[:2]
        is_told = isinstance(severity, ast.Name) and severity.id.isupper()
        word = severity.id.lower() if is_told else None
        word = {"error": "error", "warn": "warning"}.get(name, word)
        for number in numbers(row, tree):
            self._note(f"{LINT}{number:02d}", None, word)


def numbers(node, tree):
    if isinstance(node, ast.Name):
        return {
            value
            for item in ast.walk(tree)
            if isinstance(item, ast.Assign) and ast.unparse(item.targets[0]) == node.id
            for value in numbers(item.value, tree)
        }
    if isinstance(node, ast.IfExp):
        return numbers(node.body, tree) | numbers(node.orelse, tree)
    return {node.value} if isinstance(node, ast.Constant) else set()


def severities_of(call):
    """Return the severities that a call may give its finding, None where it cannot be told."""
    if isinstance(call, ast.arguments):
        return [None]
    name, first = ast.unparse(call.func).rpartition(".")[2], ast.unparse(call.args[0])
    if first.startswith("Severity."):
        return [word.lower() for word in re.findall(r"Severity\.([A-Z]+)", first)]
    if name == "warn":
        return ["warning"]
    is_error = name in ("error", "fix", "_error") or name.endswith("Error")
    return ["error" if is_error else None]


@pytest.fixture(scope="module")
def source():
    return Source(PACKAGE)


def test_every_code_that_is_raised_is_explained(source):
    assert len(source.modules) > 300
    assert not set(source.modules) - {entry.code for entry in ENTRIES}


def test_every_code_that_is_explained_is_raised(source):
    assert {entry.code for entry in ENTRIES} == set(source.modules) | set(RunKind)
    assert source.kinds == set(RunKind)


def test_no_other_codes_are_put_together(source):
    assert source.built == {LINT, REASON}


def test_no_code_is_raised_in_a_second_module_unless_the_catalogue_says_so(source):
    found = {e.code: len(source.modules[e.code]) for e in ENTRIES if source.modules[e.code]}
    expected = {entry.code: entry.modules for entry in ENTRIES if entry.code in found}
    wrong = {code: sorted(source.modules[code]) for code in found if found[code] != expected[code]}
    assert not wrong, "give the second meaning a code of its own, or write modules = n"


def test_severity_is_the_one_that_is_raised(source):
    for entry in ENTRIES:
        raised = source.severities[entry.code]
        if entry.severity is None and entry.code in set(RunKind):
            assert raised > {"error"} or None in raised, entry.code
        elif entry.severity is None:
            assert len(raised) > 1, entry.code
        else:
            assert raised - {None} <= {entry.severity}, entry.code


def test_a_second_meaning_in_another_module_is_found(tmp_path):
    (tmp_path / "speeds.py").write_text('Issue(Severity.ERROR, "PLN205", "no feed")\n')
    (tmp_path / "curves.py").write_text('raise CellError("PLN205", "no stiffness")\n')
    (tmp_path / "reasons.py").write_text('REASONS = {"PLN205": "speed"}\n"""PLN205 again."""\n')
    assert Source(tmp_path).modules["PLN205"] == {"speeds.py", "curves.py"}


@pytest.mark.parametrize("path", sorted((PACKAGE / "codes").glob("*.toml")), ids=lambda p: p.stem)
def test_a_file_holds_the_codes_of_its_prefix_and_known_keys_only(path):
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    assert tables.pop("about").strip()
    for code, table in tables.items():
        is_kind = path.stem == "ver" and code in set(RunKind)
        assert is_kind or re.fullmatch(rf"{path.stem.upper()}\d{{3}}", code)
        assert set(table) <= PLANNED
    assert list(tables) == sorted(tables)


def test_texts_are_whole_sentences():
    for entry in ENTRIES:
        assert entry.title.strip() == entry.title != "", entry.code
        assert not entry.title.endswith("."), entry.code
        assert entry.cause != entry.remedy, entry.code
        for text in (entry.cause, entry.remedy):
            assert text.endswith("."), entry.code
            assert text == " ".join(text.split()), entry.code
            assert text.isascii(), f"{entry.code}: not every terminal shows it"
            assert len(text.split()) >= 4, entry.code


def test_no_text_was_copied_from_another_code():
    causes = [entry.cause for entry in ENTRIES]
    assert len(set(causes)) == len(causes)
    for group in groups():
        titles = [entry.title for entry in group.entries]
        assert len(set(titles)) == len(titles), group.prefix


def test_codes_are_unique_and_found():
    codes = [entry.code for entry in ENTRIES]
    assert len(set(codes)) == len(codes)
    assert all(find(entry.code) is entry for entry in ENTRIES)
    assert find("APT999") is None
    assert find("XYZ001") is None
    assert find("") is None


def test_nearest_codes():
    assert "APT012" in nearest("APT011")
    assert nearest("APT999")[0].startswith("APT1")
    assert "APT012" in nearest("ATP012")
    assert "joint_limit" in nearest("joint limits")
    assert nearest("VER999")[0].startswith("VER")
    assert nearest("12?") == ()
