"""Estimated times and speed profiles; the only user of ruckig."""
