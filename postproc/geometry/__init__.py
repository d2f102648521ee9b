"""Frames, rotations, lines and arcs."""
