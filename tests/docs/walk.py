"""Pages of documentation, followed as their reader would, in an empty folder.

What a page asks for is done in its order:

- a block with ``title="NAME"`` is a file: it is written;
- every line of an ``sh`` block is run; ``# exit code N`` behind it says how it ends, else 0;
- a ``python`` block without a title is run, in one namespace for the page.

Blocks of other kinds (``text``, ``console``, ``yaml``, ``krl``) are only shown. ``fixtures`` and
``docs/examples`` of the repository lie in the folder, as in a clone.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import resource
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from postproc.cli import app
from tests.places import ROOT

PAGES = [
    ROOT / "README.md",
    *(
        path
        for path in sorted((ROOT / "docs").rglob("*.md"))
        if "examples" not in path.relative_to(ROOT / "docs").parts
    ),
]
FENCE = re.compile(r"^( *)```(\w+)([^\n]*)\n(.*?)^\1```$", re.DOTALL | re.MULTILINE)
EXIT = re.compile(r"exit code (\d+)")
PROMISE = re.compile(r"the\s+computer\s+takes\s+(?:about\s+)?(\d+) s", re.IGNORECASE)
SHELL_SIGNS = set("|><;&$`*?")


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, the file that it is (or nothing), its text and line."""

    language: str
    file: str
    text: str
    line: int

    @property
    def runs(self) -> bool:
        return bool(self.file) or self.language in ("sh", "python")

    def commands(self) -> Iterator[tuple[str, int]]:
        """Yield each line of a shell block with its exit code, continued lines joined."""
        for line in self.text.replace("\\\n", " ").splitlines():
            command, _, remark = line.partition("  #")
            said = EXIT.search(remark)
            if command.strip() and not command.startswith("#"):
                yield command.strip(), int(said.group(1)) if said else 0


def blocks(page: Path) -> list[Block]:
    """Return the fenced blocks of a page in their order."""
    text = page.read_text(encoding="utf-8")
    result = []
    for match in FENCE.finditer(text):
        indent, language, rest, body = match.groups()
        title = re.search(r'title="([^"]+)"', rest)
        body = re.sub(rf"^{indent}", "", body, flags=re.MULTILINE)
        line = text.count("\n", 0, match.start()) + 1
        result.append(Block(language, title.group(1) if title else "", body, line))
    return result


def promised_seconds(page: Path) -> int | None:
    """Return how long the page says that the computer takes."""
    said = PROMISE.search(page.read_text(encoding="utf-8"))
    return int(said.group(1)) if said else None


@dataclass
class Walk:
    """A reader with a shell: ``folder`` is where it stands, ``cpu`` what the commands have cost."""

    folder: Path
    site: Path | None = None
    names: dict[str, object] = field(default_factory=lambda: {"__name__": "__main__"})
    told: str = ""
    cpu: float = 0.0

    def follow(self, page: Path) -> None:
        """Do what the page asks for."""
        for name in ("fixtures", "docs"):
            (self.folder / name).symlink_to(ROOT / name)
        start = _cpu()
        for block in blocks(page):
            where = f"{page}:{block.line}"
            if block.file:
                target = self.folder / block.file
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_text(block.text, encoding="utf-8")
            elif block.language == "python":
                self._python(block.text, where)
            elif block.language == "sh":
                for command, code in block.commands():
                    self._shell(command, code, where)
        self.cpu = _cpu() - start

    def _python(self, text: str, where: str) -> None:
        stream = io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(stream):
            exec(compile(text, where, "exec"), self.names)
        self.told += stream.getvalue()

    def _shell(self, command: str, code: int, where: str) -> None:
        words = shlex.split(command)
        if words[0] == "cd":
            self.folder = (self.folder / words[1]).resolve()
            return
        if words[:2] == ["pip", "install"]:
            self.site = self.folder / "site-packages"
            command = (
                f"{sys.executable} -m pip install -q --no-deps --target {self.site} {words[2]}"
            )
            command += " --disable-pip-version-check"
        if words[0] == "postproc" and self.site is None and not SHELL_SIGNS & set(command):
            done, told = self._here(words[1:])
        else:
            done, told = self._in_a_shell(command)
        self.told += told
        assert done == code, f"{where}: {command}\nexit code {done}, not {code}\n{told}"
        assert "Traceback" not in told, f"{where}: {command}\n{told}"

    def _here(self, words: list[str]) -> tuple[int, str]:
        stream = io.StringIO()
        with (
            contextlib.chdir(self.folder),
            contextlib.redirect_stdout(stream),
            contextlib.redirect_stderr(stream),
        ):
            done = app.run(words)
        return int(done), stream.getvalue()

    def _in_a_shell(self, command: str) -> tuple[int, str]:
        places = [str(self.site)] if self.site else []
        environment = {
            **os.environ,
            "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
            "PYTHONPATH": os.pathsep.join([*places, str(ROOT)]),
        }
        text = f'postproc() {{ {shlex.quote(sys.executable)} -m postproc "$@"; }}\n{command}'
        done = subprocess.run(
            ["bash", "-c", text],
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout + done.stderr


def _cpu() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime
