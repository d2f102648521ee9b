"""Candidates per tag, costs, ladder search, key tags and smoothing, motions in between."""
