"""Dataclasses that are cheap to define: those of all our modules.

``dataclasses`` writes and compiles up to seven functions for each frozen class, half a millisecond,
and a command loads 300 of them. Here what shows, compares, hashes and refuses to be changed are
functions that all these classes share. All else is as with ``dataclasses``: ``__init__``, fields,
defaults, slots, ``replace``, equality and hash by fields, ``FrozenInstanceError``.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

Decorator = Callable[[type], type]

if TYPE_CHECKING:
    from dataclasses import dataclass
    from dataclasses import dataclass as record
else:

    def dataclass(
        *,
        frozen: bool = False,
        slots: bool = False,
        kw_only: bool = False,
        eq: bool = True,
        guarded: bool = True,
    ) -> Decorator:
        """Return a decorator that makes a class of fields.

        Args:
            frozen: instances have a hash, and a field is set once, by ``__init__``.
            slots: as with ``dataclasses.dataclass``.
            kw_only: as there.
            eq: False: an instance equals itself alone.
            guarded: False: only the type checker refuses to set a field of a frozen instance.
        """

        def made(plain: type) -> type:
            own = set(vars(plain))
            plain.__doc__ = plain.__doc__ or plain.__name__  # else its signature is worked out
            with _as_not_frozen(plain):
                cls = dataclasses.dataclass(repr=False, eq=False, slots=slots, kw_only=kw_only)(
                    plain
                )
            cls.__dataclass_params__.frozen = frozen
            shared = {"__repr__": _repr}
            if eq:
                compared = [field.name for field in dataclasses.fields(cls) if field.compare]
                cls._compared = staticmethod(attrgetter(*compared) if compared else type)
                shared |= {"__eq__": _eq, "__hash__": _hash if frozen else None}
            if frozen:
                once = _set_once if slots else _set_field_once
                shared["__setattr__"] = once if guarded else object.__setattr__
                shared["__delattr__"] = _keep if guarded else object.__delattr__
            for name, method in shared.items():
                if name not in own:
                    setattr(cls, name, method)
            return cls

        return made

    record = partial(dataclass, guarded=False)
    """For what exists by the hundred thousand: the guard is called for each field of each one."""


@contextmanager
def _as_not_frozen(plain: type) -> Iterator[None]:
    """Let a class derive from frozen ones though its decorator is not told that it is frozen."""
    bases = [getattr(base, "__dataclass_params__", None) for base in plain.__mro__[1:]]
    frozen = [params for params in bases if params is not None and params.frozen]
    for params in frozen:
        params.frozen = False
    try:
        yield
    finally:
        for params in frozen:
            params.frozen = True


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


def _set_once(self: object, name: str, value: object) -> None:
    if hasattr(self, name):
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    object.__setattr__(self, name, value)


def _set_field_once(self: Any, name: str, value: object) -> None:  # noqa: ANN401 - as above
    if name in vars(self) or name not in self.__dataclass_fields__:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    object.__setattr__(self, name, value)


def _keep(_self: object, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


__all__ = ["dataclass", "record"]
