"""Recordings of paths with a hidden cause, from a dynamic robot of its own."""
