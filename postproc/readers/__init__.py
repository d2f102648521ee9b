"""CAM files to ToolPath; one format per file, found by the registry."""

from postproc.readers.base import ReadOptions, read

__all__ = ["ReadOptions", "read"]
