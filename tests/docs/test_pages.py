"""README and docs: every runnable block runs and ends as the page says, within its time."""

import importlib
import re
from pathlib import Path

import pytest

import postproc
from postproc.cli.app import COMMANDS
from tests.docs.walk import FENCE, PAGES, Walk, blocks, promised_seconds
from tests.places import ROOT

DOCS = ROOT / "docs"
RUNNING = [page for page in PAGES if any(block.runs for block in blocks(page))]
SLOW = {
    "docs/howto/rail.md",
    "docs/howto/several-tools.md",
    "docs/howto/spin.md",
    "docs/tutorials/ci.md",
    "docs/tutorials/engineer.md",
    "docs/tutorials/integrator.md",
    "docs/tutorials/metrologist.md",
    "docs/tutorials/plugin.md",
    "docs/tutorials/python.md",
    "docs/tutorials/solids.md",
}
"""Pages that take more than a few seconds."""
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
CALL = re.compile(r"(?:^|[ -])postproc ([a-z][a-z-]*)([^\n|]*)", re.MULTILINE)


def name_of(page):
    return page.relative_to(ROOT).as_posix()


def code_of(page):
    """Return what stands in code on a page, Python left out."""
    texts = [block.text for block in blocks(page) if block.language != "python"]
    fenced = [re.sub("  +#.*", "", text) for text in texts]
    prose = FENCE.sub("", page.read_text(encoding="utf-8"))
    return "\n".join([*fenced, *re.findall(r"`([^`]+)`", prose)]).replace("\\\n", " ")


def marked(page):
    return pytest.param(
        page, id=name_of(page), marks=[pytest.mark.slow] if name_of(page) in SLOW else []
    )


@pytest.mark.causes
@pytest.mark.parametrize("page", [marked(page) for page in RUNNING])
def test_every_runnable_block(page, tmp_path):
    walk = Walk(tmp_path)
    walk.follow(page)
    promise = promised_seconds(page)
    if promise is not None:
        assert walk.cpu < promise


def test_tutorials_run_and_promise_a_time():
    for page in sorted((DOCS / "tutorials").glob("*.md")):
        assert page in RUNNING, page
        assert promised_seconds(page) is not None, page


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_named_commands_and_options_exist(page):
    """What is only shown, or stands in a sentence, names commands and options that exist."""
    for name, rest in CALL.findall(code_of(page)):
        assert name in COMMANDS, f"{page}: postproc {name}"
        module = importlib.import_module(f"postproc.cli.commands.{name.replace('-', '_')}")
        known = {option for parameter in module.command.params for option in parameter.opts}
        for option in OPTION.findall(rest):
            assert option in known | {"--help"}, f"{page}: postproc {name} {option}"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_named_files_and_links_are_there(page):
    text = page.read_text(encoding="utf-8")
    package = Path(postproc.__file__).parents[1]  # the checkout, or where the wheel is installed
    for name in re.findall(r"`((?:docs|tests|tools|fixtures|postproc)/[\w./]+)`", text):
        assert any((root / name).exists() for root in (ROOT, package)), f"{page}: {name}"
    if page.name == "README.md":  # mkdocs checks those of the other pages
        for target in re.findall(r"\]\(([^)#:]+)\)", text):
            assert (ROOT / target).exists(), target


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 150


def test_a_wrong_block_is_seen(tmp_path):
    folder = tmp_path / "walk"
    folder.mkdir()
    page = tmp_path / "page.md"
    for text in ("```sh\npostproc robots nobody\n```", "```python\nassert False\n```"):
        page.write_text(text, encoding="utf-8")
        walk = Walk(folder)
        with pytest.raises(AssertionError):
            walk.follow(page)
        for link in folder.iterdir():
            link.unlink()
    page.write_text("```sh\npostproc robots nobody  # exit code 2\n```", encoding="utf-8")
    Walk(folder).follow(page)
