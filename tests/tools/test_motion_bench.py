"""A small slice of the bench of motion checks: nothing that brute force finds is let pass."""

from tools.bench.motion import judged


def test_nothing_is_missed():
    tallies = judged(cells=3, moves=8, seed=3)
    assert {name: tally.missed for name, tally in tallies.items()} == dict.fromkeys(tallies, 0)
    assert sum(tally.moves for tally in tallies.values()) > 15
    assert sum(tally.refused for tally in tallies.values()) < 10
