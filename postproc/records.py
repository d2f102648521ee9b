"""Dataclasses that are cheap to define and to make, for what exists by the hundred thousand.

``dataclasses`` writes and compiles six functions for each frozen class, and each frozen instance
sets its fields through a call: a program of 30,000 motions takes twice the time to read for that.
Here ``frozen=True`` is a promise that the type checker holds; at run time an assignment is not
refused. Text and comparison come from functions that all these classes share. All else is as with
``dataclasses``: fields, defaults, slots, ``replace``, equality and hash by fields.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

Decorator = Callable[[type], type]

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(*, frozen: bool = False, slots: bool = False, kw_only: bool = False) -> Decorator:
        """Return a decorator that makes a class of fields.

        Args:
            frozen: instances have a hash; the type checker refuses to assign to a field.
            slots: as with ``dataclasses.dataclass``.
            kw_only: as there.
        """

        def made(plain: type) -> type:
            own = vars(plain)
            cls = dataclasses.dataclass(repr=False, eq=False, slots=slots, kw_only=kw_only)(plain)
            compared = [field.name for field in dataclasses.fields(cls) if field.compare]
            cls._compared = staticmethod(attrgetter(*compared) if compared else type)
            shared = {"__repr__": _repr, "__eq__": _eq, "__hash__": _hash if frozen else None}
            for name, method in shared.items():
                if name not in own:
                    setattr(cls, name, method)
            return cls

        return made


@recursive_repr()
def _repr(self: Any) -> str:  # noqa: ANN401 - any of these classes
    shown = (field.name for field in dataclasses.fields(self) if field.repr)
    values = ", ".join(f"{name}={getattr(self, name)!r}" for name in shown)
    return f"{type(self).__qualname__}({values})"


def _eq(self: Any, other: Any) -> Any:  # noqa: ANN401 - as above
    if other.__class__ is not self.__class__:
        return NotImplemented
    return self._compared(self) == self._compared(other)


def _hash(self: Any) -> int:  # noqa: ANN401 - as above
    return hash(self._compared(self))


__all__ = ["dataclass"]
