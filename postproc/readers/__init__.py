"""CAM files to ToolPath; one format per file, found by the registry."""

from postproc.readers.base import (
    HEAD_BYTES,
    LENGTH_UNITS,
    READERS,
    Reader,
    ReadOptions,
    SurfaceNormals,
    read,
    read_options,
)
from postproc.readers.csv import holes_of, read_pins
