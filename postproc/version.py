"""The version of postproc."""

__version__ = "0.3.0"
