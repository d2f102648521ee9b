"""The version of postproc."""

__version__ = "0.6.0"
