"""Half turns by their records, proven by other arcs of the file: cusps are not rounded off.

Files are drawn: chains of half turns in any plane, joined at cusps (scallops), smoothly (waves) or
by straight cuts. The truth is the side on which the middle of each half turn was drawn.
"""

import numpy as np
import pytest

from postproc.errors import UsageError
from postproc.model.toolpath import MotionKind
from postproc.readers import ReadOptions

HEAD = "PARTNO X\nUNITS/MM\nFEDRAT/500,MMPM\n"
TURNED = "MODE/MILL\nPARTNO/'X'\nPPRINT/'X'\nUNITS/MM\nFEDRAT/500.,MMPM\n"
"""The head of Autodesk's posts; those of 2019 and later write whole numbers with a point."""


def numbers(values, digits=6):
    return ", ".join(f"{value:.{digits}f}" for value in np.ravel(values))


def whole(values):
    """As a post does that writes no point behind whole numbers."""
    return ", ".join(
        np.format_float_positional(v, 6, trim="-") for v in np.round(np.ravel(values), 6) + 0.0
    )


class Chain:
    """A file under way, and the middles of its half turns."""

    def __init__(self, rng, head=HEAD, write=numbers, form="MOVARC/{}, {}, {}, ANGLE, {}"):
        self.n, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        self.n[:, 2] = np.cross(self.n[:, 0], self.n[:, 1])
        self.at, self.text, self.middles = rng.uniform(-50, 50, 3), head, []
        self.write, self.form = write, form
        self.go(self.at)

    def go(self, point):
        self.at = np.asarray(point, dtype=float)
        self.text += f"GOTO/{numbers(self.at)}\n"

    def arc(self, u, radius, degrees, side, vector=1.0):
        """Turn by degrees about side * n, from a centre at radius * u; vector * n is written."""
        axis = side * self.n[:, 2]
        centre = self.at + radius * u
        out = self.at - centre

        def turned(angle):
            return centre + np.cos(angle) * out + np.sin(angle) * np.cross(axis, out)

        angle = np.radians(degrees)
        self.text += (
            self.form.format(
                self.write(centre),
                self.write(vector * axis),
                self.write(radius),
                self.write(degrees),
            )
            + "\n"
        )
        if degrees == 180:
            self.middles.append(turned(angle / 2))
        self.go(turned(angle))

    def read(self, read_text, **options):
        toolpath = read_text(self.text + "END\nFINI\n", **options)
        refused = [use.word for use in toolpath.word_uses if use.refused]
        return drawn(toolpath), refused


def drawn(toolpath):
    """Return the middle points (m, 3) [mm] of the half turns, from the model's own columns."""
    tags = np.flatnonzero(toolpath.kind == MotionKind.ARC)
    tags = tags[np.isclose(toolpath.arcs.sweep[toolpath.arc[tags]], np.pi)]
    arc, start = toolpath.arc[tags], toolpath.points[tags - 1]
    centre = toolpath.arcs.centre[arc]
    return 1e3 * (centre + np.cross(toolpath.arcs.normal[arc], start - centre))


def scalloped(rng, chain):
    """Add half turns: with cusps (always one), waves and straight cuts between them."""
    u, side = chain.n[:, 0], 1.0
    for cusp in [True, *(rng.random(4) < 0.5)]:
        chain.arc(u, rng.uniform(2, 30), 180, side)
        side = side if cusp else -side
        if rng.random() < 0.3:
            chain.go(chain.at + 5 * chain.n[:, 1] * rng.choice([1, -1]))
    chain.arc(u, 8.0, 180, 1.0)
    chain.arc(u, 8.0, 180, 1.0)


def off(chain, found):
    return np.linalg.norm(found - np.array(chain.middles), axis=1).max()


@pytest.mark.parametrize("place", ["first", "last"])
def test_another_arc_that_closes_ccw_proves_every_half_turn(read_text, place):
    rng, wrong = np.random.default_rng(1), []
    for seed in range(30):
        chain = Chain(rng)
        if place == "first":
            chain.arc(chain.n[:, 1], 6.0, rng.uniform(5, 175), 1.0)
        scalloped(rng, chain)
        if place == "last":
            chain.arc(chain.n[:, 1], 6.0, rng.uniform(185, 300), -1.0)
        found, refused = chain.read(read_text)
        if refused or off(chain, found) > 1e-4:
            wrong.append((seed, refused))
    assert not wrong


def test_without_a_proof_a_half_turn_against_its_neighbour_is_asked_back(read_text):
    """No other arc; one that closes clockwise, alone or beside one that does not: all the same."""
    rng, wrong = np.random.default_rng(2), []
    for seed in range(30):
        chain = Chain(rng)
        for vector in ((), (-1.0,), (1.0, -1.0))[seed % 3]:
            chain.arc(chain.n[:, 1], 6.0, 70.0, 1.0, vector)
        scalloped(rng, chain)
        if (
            set(chain.read(read_text)[1]) != {"MOVARC"}
            or chain.read(read_text, accept_words="MOVARC")[1]
        ):
            wrong.append(seed)
        for told, sign in (("ccw", 1), ("cw", -1)):
            found, refused = chain.read(read_text, arc_sense=told)
            if refused or (off(chain, found) > 1e-4) == (sign > 0):
                wrong.append((seed, told, refused))
    assert not wrong


def test_half_turns_that_go_on_as_what_lies_beside_them_need_no_proof(read_text):
    rng, wrong = np.random.default_rng(3), []
    for seed in range(20):
        chain = Chain(rng)
        u, v = chain.n[:, 0], chain.n[:, 1]
        chain.go(chain.at - 9 * v)
        chain.go(chain.at + 9 * v)
        for step in range(5):
            side = -1.0 if step % 2 == 0 else 1.0
            chain.arc(u, rng.uniform(2, 30), 180, side)
        chain.go(chain.at + 4 * side * v)
        found, refused = chain.read(read_text)
        if off(chain, found) > 1e-4 or refused:
            wrong.append((seed, refused))
    assert not wrong


def test_a_post_that_turns_vectors_over_is_a_proof_and_those_of_2011_are_none(read_text):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        for head, write, proven in ((TURNED, numbers, True), (TURNED, whole, False),
                                    (HEAD, numbers, False)):  # fmt: skip
            chain = Chain(rng, head, write)
            chain.n = np.eye(3)
            scalloped(rng, chain)
            found, refused = chain.read(read_text)
            assert off(chain, found) < 1e-4
            assert set(refused) == (set() if proven else {"MOVARC"}), (seed, head, write)


@pytest.mark.parametrize("vector", [1.0, -1.0])
def test_circles_of_plain_apt_go_as_those_with_tangent_cuts_of_the_same_file(read_text, vector):
    """Systems differ in what the vector of CIRCLE means; one file has one meaning."""
    rng, wrong = np.random.default_rng(4), []
    for seed in range(20):
        chain = Chain(rng, form="CIRCLE/{}, {}, {}")
        n = chain.n
        for side in (1.0, -1.0):
            chain.go(chain.at - 9 * side * n[:, 1])
            chain.arc(n[:, 0], rng.uniform(2, 9), 90, side, vector)
            chain.go(chain.at + 7 * n[:, 0])
        for side in (1.0, 1.0, -1.0):
            chain.arc(n[:, 0], rng.uniform(2, 9), 180, side, vector)
        found, refused = chain.read(read_text)
        if refused or off(chain, found) > 1e-4:
            wrong.append((seed, refused))
    assert not wrong


def test_circles_of_plain_apt_that_contradict_each_other_are_asked_back(read_text):
    rng = np.random.default_rng(5)
    chain = Chain(rng, form="CIRCLE/{}, {}, {}")
    for vector in (1.0, -1.0):
        chain.go(chain.at + 9 * chain.n[:, 1])
        chain.arc(chain.n[:, 0], 5.0, 90, -1.0, vector)
    assert chain.read(read_text)[1] == ["CIRCLE"]
    assert chain.read(read_text, arc_sense="ccw")[1] == []


def test_a_sense_that_is_none_is_refused():
    with pytest.raises(UsageError, match="known are ccw, cw"):
        ReadOptions(arc_sense="left")
