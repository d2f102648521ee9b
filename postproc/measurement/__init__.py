"""Measuring campaigns: rows, files, registration."""
