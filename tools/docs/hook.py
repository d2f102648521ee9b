"""Hook of mkdocs: the pages and files that are made from the code at build time.

A page that the code can tell is not written by hand: commands, cell keys, columns, documents and
findings come from where they are defined, figures and examples from running the product.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))  # mkdocs loads a hook by its file

from tools.docs import examples, figures, reference  # noqa: E402

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files


def generated() -> dict[str, str | bytes]:
    """Return everything that is made at build time, by its place in ``docs``."""
    return {**reference.pages(), **examples.pages(ROOT / "fixtures"), **figures.pictures(ROOT)}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated files to those of ``docs``."""
    from mkdocs.structure.files import File

    for name, content in generated().items():
        files.append(File.generated(config, name, content=content))
    return files
