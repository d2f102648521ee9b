"""The checks of lint, a few rows of the table to a file; the table is in ``krl.lint``."""
