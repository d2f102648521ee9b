"""The ES modules of the assets folder as one script: a page has no files to import from.

Each module becomes a function that returns what the module exports, so names stay its own; modules
stand in the order of their imports. Understood are the forms that the assets use, anything else is
refused: ``import { a, b } from "./file.js";`` at the start of a line, ``export`` before a function,
class or const; a bundle has one list ``export{a as b};`` at its end instead.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from postproc.records import dataclass

ASSETS = Path(__file__).parent.parent / "assets"
_BUNDLE = ".bundle.js"
_IMPORT = re.compile(
    r'^import \{\s*(\w+(?:,\s*\w+)*),?\s*\} from "\./([\w.]+\.js)";$', re.MULTILINE
)
_EXPORT = re.compile(r"^export (?=(?:(?:async )?function|class|const) (\w+))", re.MULTILINE)
_EXPORT_LIST = re.compile(r"\bexport\{([\w$, ]*)\};\s*\Z")
_OTHER = re.compile(r"^(?:import|export)\b.*|\b(?:export\{|import\().*", re.MULTILINE)


@cache
def one_script(entry: str, folder: Path = ASSETS) -> str:
    """Return a module and all that it imports as one script; ValueError where that is not clear."""
    modules: dict[str, _Module] = {}
    _add(entry, folder, modules, ())
    return "".join(module.as_constant() for module in modules.values())


@dataclass(frozen=True, slots=True)
class _Module:
    """A module: its file's name, its text without the exports, from exported to own names."""

    name: str
    text: str
    exports: Mapping[str, str]

    def as_constant(self) -> str:
        """Return the module as a constant, the object of its exports."""
        shown = (name if name == own else f"{name}: {own}" for name, own in self.exports.items())
        text = _IMPORT.sub(_destructured, self.text)
        head, end = f"const {_constant(self.name)} = (() => {{", f"return {{ {', '.join(shown)} }};"
        return f"{head}\n{text}\n{end}\n}})();\n"


def _destructured(found: re.Match[str]) -> str:
    return f"const {{ {found[1]} }} = {_constant(found[2])};"


def _add(name: str, folder: Path, modules: dict[str, _Module], above: tuple[str, ...]) -> None:
    """Add a module behind those that it imports; ``above`` are the modules that import it."""
    if name in above:
        raise ValueError(f"modules import each other: {' > '.join((*above, name))}")
    if name in modules:
        return
    module = _read(folder / name)
    for names, imported in _IMPORT.findall(module.text):
        _add(imported, folder, modules, (*above, name))
        missing = set(re.findall(r"\w+", names)) - set(modules[imported].exports)
        if missing:
            raise ValueError(f"{name}: {imported} does not export {', '.join(sorted(missing))}")
    modules[name] = module


def _read(path: Path) -> _Module:
    text = path.read_text(encoding="utf-8")
    exports: dict[str, str] = {}
    if path.name.endswith(_BUNDLE):
        listed = _EXPORT_LIST.search(text)
        if listed:
            pairs = [pair.split(" as ") for pair in listed[1].split(",")]
            exports = {pair[-1]: pair[0] for pair in pairs}
            text = text[: listed.start()]
    else:
        text = _without_layout(text)
        exports = {name: name for name in _EXPORT.findall(text)}
        text = _EXPORT.sub("", text)
    other = _OTHER.search(_IMPORT.sub("", text))
    if other:
        raise ValueError(f"{path.name}: this form is not understood: {other[0][:80]}")
    return _Module(path.name, text, exports)


def _constant(name: str) -> str:
    return "$" + re.sub(r"\W", "_", name.removesuffix(".js"))


def _without_layout(text: str) -> str:
    """Return a script without indents, empty lines and lines that are comments."""
    lines = (line.strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith("//"))
