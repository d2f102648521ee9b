"""Extension of griffe: classes of ``postproc.records.dataclass`` are dataclasses to the reference.

Griffe knows a dataclass by the path of its decorator. Without this the fields that a docstring
describes are no parameters of anything, and each is a warning that ends a strict build.
"""

from __future__ import annotations

import griffe


class Records(griffe.Extension):
    """Gives the decorator the path of the standard library's."""

    def on_class_instance(self, *, cls: griffe.Class, **_: object) -> None:
        """Rename the decorator of a record while the class is read."""
        for decorator in cls.decorators:
            value = decorator.value
            name = value.function if isinstance(value, griffe.ExprCall) else value
            if isinstance(name, griffe.ExprName) and name.name == "dataclass":
                name.name, name.parent = "dataclasses.dataclass", None
