from collections.abc import Callable
from pathlib import Path

import pytest

from postproc.cell import call_keys
from postproc.model.toolpath import ToolPath
from postproc.readers import ReadOptions, read
from tests.places import SHARED

FIXTURES = Path(__file__).parent / "data"
CORPUS = SHARED / "corpus"


@pytest.fixture(scope="session")
def fixtures() -> Path:
    return FIXTURES


@pytest.fixture(scope="session")
def corpus() -> Path:
    if not CORPUS.is_dir():
        pytest.skip("the shared corpus is not beside this checkout")
    return CORPUS


@pytest.fixture
def read_text(tmp_path: Path) -> Callable[..., ToolPath]:
    """Return a function that reads a text as a file."""

    def reading(
        text: str | bytes, name: str = "input.apt", format: str = "auto", **options: object
    ) -> ToolPath:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
        given = {"format": format, **options}
        return read(path, ReadOptions(**{**given, **call_keys(given)}))

    return reading
