"""Names that are one slip of the pen away from a known one."""

from __future__ import annotations

from collections.abc import Collection

_SHORTEST = 3


def nearest(name: str, known: Collection[str], *, counts_digits: bool = True) -> str:
    """Return the known name that a name differs from by one slip, empty if there is none.

    A slip is one wrong or missing character, a letter written twice, or two that are swapped. A
    name with something before or behind it is another name, not a slip.

    Args:
        name: in upper case.
        known: names in upper case; name is none of them.
        counts_digits: another digit is a slip, too; in families of names it is not.
    """
    length = len(name.lstrip("$"))
    if length < _SHORTEST:
        return ""
    near = (other for other in known if len(other.lstrip("$")) >= _SHORTEST)
    return min((other for other in near if _is_slip(name, other, counts_digits)), default="")


def _is_slip(name: str, other: str, counts_digits: bool) -> bool:
    if abs(len(name) - len(other)) > 1:
        return False
    at = next((i for i, (a, b) in enumerate(zip(name, other, strict=False)) if a != b), None)
    if at is None:  # one is the beginning of the other
        longer = max(name, other, key=len)
        return len(name) < len(other) or longer[-1] == longer[-2]
    if len(name) < len(other):
        return name[at:] == other[at + 1 :]
    if len(name) > len(other):
        return name[at + 1 :] == other[at:] and name[at] == name[at - 1]
    is_swap = name[at : at + 2] == other[at : at + 2][::-1] and name[at + 2 :] == other[at + 2 :]
    is_digit = name[at].isdigit() or other[at].isdigit()
    return is_swap or (name[at + 1 :] == other[at + 1 :] and (counts_digits or not is_digit))
