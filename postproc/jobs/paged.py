"""What every finished job with a page can do with it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path

from postproc.files import write_files


def written(folder: str | Path, files: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Write files of a job into a folder, whole or not at all, and return their paths."""
    contents = {Path(folder) / name: content for name, content in files.items()}
    write_files(contents)
    return tuple(contents)


class Paged(ABC):
    """A finished job that has a page: one HTML file that opens offline."""

    @abstractmethod
    def page(self) -> bytes:
        """Return the page: one HTML file that opens offline."""

    def report(self, file: str | Path) -> Path:
        """Write the page alone and return its path.

        Args:
            file: the HTML file.

        Returns:
            Its path.

        Raises:
            ReadError: if it cannot be written.
        """
        write_files({Path(file): self.page()})
        return Path(file)
