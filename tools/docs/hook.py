"""Hook of mkdocs: the pages and files that are made from the code at build time.

A page that the code can tell is not written by hand: commands, cell keys, columns, documents and
findings come from where they are defined, figures and examples from running the product.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))  # mkdocs loads a hook by its file

from tools.docs import examples, figures, reference  # noqa: E402

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files


def generated() -> dict[str, str | bytes]:
    """Return everything that is made at build time, by its place in ``docs``."""
    return {**reference.pages(), **examples.pages(ROOT / "fixtures"), **figures.pictures(ROOT)}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the pages of the families of findings where the navigation has their list."""

    def with_families(entry: Any) -> Any:  # noqa: ANN401 - the navigation's own nesting
        if isinstance(entry, list):
            return [with_families(one) for one in entry]
        if not isinstance(entry, dict):
            return entry
        pages = {name: with_families(part) for name, part in entry.items()}
        if "Finding codes" in pages:
            pages["Finding codes"] = [
                {"All families": pages["Finding codes"]},
                *({title: page} for title, page in reference.families()),
            ]
        return pages

    config.nav = with_families(config.nav)
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated files to those of ``docs``."""
    from mkdocs.structure.files import File

    for name, content in generated().items():
        files.append(File.generated(config, name, content=content))
    return files
