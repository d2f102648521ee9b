"""Expands one xacro file in a process of its own, which may be ended: ``expansion.py FILE``.

Says the URDF text, or why there is none with exit code 1; 2 where it is too much. The folders of
packages come as JSON.
"""

from __future__ import annotations

import json
import sys
from xml.parsers.expat import ExpatError

_LARGEST = 1 << 26
"""Characters of a URDF; real ones have some ten thousand."""


def main() -> int:
    """Return the exit code."""
    import xacro
    from xacrodoc import XacroDoc, packages

    packages.update_package_cache(json.load(sys.stdin))
    try:
        document = XacroDoc.from_file(sys.argv[1], resolve_packages=False)
        text = document.to_urdf_string()
    except (
        xacro.XacroException, packages.PackageNotFoundError, ExpatError, OSError, ValueError,
        KeyError, TypeError, AttributeError, NameError, RecursionError, ArithmeticError,
    ) as problem:  # fmt: skip
        sys.stdout.write(str(problem) or type(problem).__name__)
        return 1
    except MemoryError:
        return 2
    if len(text) > _LARGEST:
        return 2
    sys.stdout.buffer.write(text.encode("utf-8"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
