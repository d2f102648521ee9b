"""Points and holes as CSV."""

from postproc.readers.csv import reader

__all__ = ["reader"]
