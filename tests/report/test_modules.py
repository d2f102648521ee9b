"""The scripts of the pages: put together as one, linted, formatted, tested where Node is there."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from postproc.report.parts.modules import ASSETS, one_script

ROOT = Path(__file__).resolve().parents[2]
VIEWER = ROOT / "tools" / "viewer"
ENTRIES = ("page.js", "program.js", "rows.js", "cell.js", "spin_map.js", "workbench.js")


@pytest.fixture
def node():
    command = shutil.which("node")
    if command is None:
        pytest.skip("no Node is installed")
    return command


@pytest.fixture
def npm_run(node):
    npm = shutil.which("npm")
    tools = [VIEWER / "node_modules" / ".bin" / name for name in ("eslint", "prettier")]
    if npm is None or not all(tool.exists() for tool in tools):
        pytest.skip("eslint and prettier are not installed: run npm install in tools/viewer")
    return lambda name: run(npm, "--prefix", str(VIEWER), "run", "--silent", name)


def run(*command):
    return subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=ROOT)


def written(folder, **texts):
    for name, text in texts.items():
        (folder / f"{name}.js").write_text(text)
    return folder


def test_names_of_modules_stay_apart(node, tmp_path):
    folder = written(
        tmp_path,
        main='import { double, SIZE } from "./tools.js";\nimport { half } from "./other.js";\n'
        "const own = 5;\nconsole.log(JSON.stringify([double(own), half(own), SIZE]));\n",
        tools='import { half } from "./other.js";\n// a comment\nconst own = 4;\n'
        "export const SIZE = own;\nexport function double(x) {\n  return half(x) * own;\n}\n",
        other="const own = 2;\nexport function half(x) {\n  return x / own;\n}\n",
    )
    page = folder / "page.mjs"
    page.write_text(one_script("main.js", folder))
    assert json.loads(run(node, str(page)).stdout) == [10, 2.5, 4]
    assert "comment" not in page.read_text()


def test_a_bundle_is_taken_with_its_list_of_exports(node, tmp_path):
    text = 'import { Big, small } from "./three.bundle.js";\nconsole.log(Big, small);\n'
    written(tmp_path, main=text)
    text = "var a=`\n  // not a comment\n`.length,$=1;export{a as Big,$ as small};\n"
    (tmp_path / "three.bundle.js").write_text(text)
    (tmp_path / "page.mjs").write_text(one_script("main.js", tmp_path))
    assert run(node, str(tmp_path / "page.mjs")).stdout == "20 1\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('import * as all from "./other.js";\n', "not understood"),
        ('import { a as b } from "./other.js";\n', "not understood"),
        ('import "./other.js";\n', "not understood"),
        ("export default 5;\n", "not understood"),
        ("const a = 5;\nexport { a };\n", "not understood"),
        ('const a = await import("./other.js");\n', "not understood"),
        ('import { b } from "./other.js";\n', "other.js does not export b"),
        ('import { back } from "./back.js";\n', "main.js > back.js > main.js"),
    ],
)
def test_what_is_not_understood_is_refused(tmp_path, text, words):
    back = 'import { x } from "./main.js";\nexport const back = 1;\n'
    folder = written(tmp_path, main=text, other="export const a = 1;\n", back=back)
    with pytest.raises(ValueError, match=words):
        one_script("main.js", folder)


@pytest.mark.parametrize("entry", ENTRIES)
def test_the_script_of_a_page_stands_alone(node, tmp_path, entry):
    script = tmp_path / "page.mjs"
    script.write_text(one_script(entry), encoding="utf-8")
    checked = run(node, "--check", str(script))
    assert checked.returncode == 0, checked.stderr
    assert ("WebGLRenderer" in script.read_text()) == (
        entry in ("program.js", "rows.js", "cell.js", "workbench.js")
    )


def test_every_module_belongs_to_a_page():
    scripts = "".join(one_script(entry) for entry in ENTRIES)
    found = set(re.findall(r"^const \$(\w+) = ", scripts, re.MULTILINE))
    assert found == {path.stem.replace(".", "_") for path in ASSETS.glob("*.js")}


def test_scripts_pass_their_tests(node):
    files = sorted(str(path) for path in (ROOT / "tests/report/assets").glob("*.test.mjs"))
    done = run(node, "--test", *files)
    assert done.returncode == 0, done.stdout[-3000:]


def test_scripts_pass_the_linter(npm_run):
    done = npm_run("lint")
    assert done.returncode == 0, done.stdout


def test_scripts_are_formatted(npm_run):
    done = npm_run("format:check")
    assert done.returncode == 0, done.stdout + done.stderr
