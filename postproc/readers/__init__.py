"""CAM files to ToolPath; one format per file, found by the registry."""

from postproc.readers.base import (
    HEAD_BYTES,
    LENGTH_UNITS,
    READERS,
    Reader,
    ReadOptions,
    SurfaceNormals,
    read,
)
from postproc.readers.csv import holes_of, read_pins

__all__ = [
    "HEAD_BYTES",
    "LENGTH_UNITS",
    "READERS",
    "ReadOptions",
    "Reader",
    "SurfaceNormals",
    "holes_of",
    "read",
    "read_pins",
]
