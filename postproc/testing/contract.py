"""How a check says that a plug-in breaks its contract."""

from __future__ import annotations

from postproc.errors import PluginError


def require(good: bool, part: str, reason: str) -> None:
    """Refuse a part that does not keep its contract.

    Raises:
        PluginError: PLG004 with the reason, unless ``good``.
    """
    if not good:
        raise PluginError("PLG004", f"{part} breaks its contract: {reason}")
