"""Whatever stands in an OLP file beyond its tables stops a program by its name."""

import random
import re

from postproc.readers import ReadOptions, read

NAMES = ("SpindleSpeed", "ToolOffset", "Tilt", "Coolant", "WeldData", "Attribute", "CornerRule")


def strange(text, seed):
    """Return the text with one element or attribute more, and its name."""
    draw = random.Random(seed)
    name = draw.choice(NAMES)
    if draw.random() < 0.5:
        at = draw.choice([m.end() for m in re.finditer(r"</[A-Z]\w*>", text)][:-1])
        more = draw.choice((f"<{name}>1</{name}>", f'<{name} Value="3000"/>'))
    else:
        at = draw.choice([m.end() for m in re.finditer(r"<[A-Z]\w*", text)])
        more = f' {name}="1"'
    return text[:at] + more + text[at:], name


def test_one_more_element_or_attribute_anywhere_is_refused_by_name(fixtures, tmp_path):
    text = (fixtures / "tasks.xml").read_text()
    good = read(fixtures / "tasks.xml", options=ReadOptions(task="Main"))
    before = [use.word for use in good.word_uses if use.refused]
    path, wrong = tmp_path / "t.xml", []
    for seed in range(120):
        changed, name = strange(text, seed)
        path.write_text(changed)
        uses = read(path, options=ReadOptions(task="Main")).word_uses
        if [use.word for use in uses if use.refused] != [*before, name]:
            wrong.append((seed, name, [use.word for use in uses]))
        accepted = read(path, options=ReadOptions(task="Main", accept_words=(name,)))
        left = [use.word for use in accepted.word_uses if use.refused]
        if left != before or len(accepted) != len(good):
            wrong.append((seed, name, "accepted"))
    assert not wrong, wrong[:4]


def test_values_that_move_the_tool_elsewhere_are_refused(fixtures, tmp_path):
    text = (fixtures / "tasks.xml").read_text()
    for old, new, name in (
        ('ApplyOffsetToTags="Off"', 'ApplyOffsetToTags="On"', "ApplyOffsetToTags"),
        ("<ToolType>OnRobot<", "<ToolType>Stationary<", "ToolType"),
    ):
        path = tmp_path / "t.xml"
        path.write_text(text.replace(old, new, 1))
        uses = read(path, options=ReadOptions(task="Main")).word_uses
        assert name in [use.word for use in uses if use.refused]
