"""The version of postproc."""

__version__ = "0.8.0"
