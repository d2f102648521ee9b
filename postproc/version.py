"""The version of postproc."""

__version__ = "0.1.0"
