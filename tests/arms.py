"""The arms that tests run on one by one; the others of the table are tested all at once."""

import csv

import pytest

from tests.places import SHARED

DETAILED = (
    "kuka_kr210_r2700_2", "kuka_kr240_r2900_2", "kuka_kr360_r2830", "kuka_kr500_r2800_2",
    "kuka_kr500_r2830", "kuka_kr600_r2830", "kuka_kr6_r900_2", "kuka_kr6_r900_sixx",
)  # fmt: skip
"""Arms with accelerations, masses or stiffness."""


def table_rows():
    """The rows of the table of arms that the built-in ones are held against."""
    path = SHARED / "docs" / "robots.tsv"
    if not path.is_file():
        pytest.skip("the table of arms is not beside the checkout")
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines, delimiter="\t"))
