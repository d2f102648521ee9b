"""A slice of the random CAM files that ``python -m tools.fuzz`` runs."""

import random

import pytest

from tools.fuzz.files import SEATS, Writer
from tools.fuzz.run import OWN_FAULTS, run


@pytest.mark.slow
def test_random_files_end_in_a_program_or_a_finding_about_the_file(tmp_path):
    outcome = run(60, 20_000, tmp_path)
    assert outcome.faults == []
    assert sum(outcome.counts.values()) == 60
    assert outcome.good >= 20
    assert not any(code.startswith(OWN_FAULTS) for code in outcome.counts)


def test_the_same_seed_is_the_same_file_and_every_seat_occurs():
    texts = [Writer(random.Random(seed)).text() for seed in (3, 3, 4)]
    assert texts[0] == texts[1] != texts[2]
    assert {Writer(random.Random(seed)).seat for seed in range(200)} == set(SEATS)
