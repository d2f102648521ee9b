"""Random CAM files through ``convert``: never CNV002, never a traceback.

python -m tools.fuzz [--count 1000] [--seed 1] [--keep DIR]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from tools.fuzz.run import run


def main() -> int:
    """Run the files, say what became of them, and return 1 if a fault is our own."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=None)
    arguments = parser.parse_args()
    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        outcome = run(arguments.count, arguments.seed, Path(folder), arguments.keep)
    for number, fault in outcome.faults:
        print(f"seed {number}: {fault}", file=sys.stderr)
    spent = time.process_time() - start
    share = 100.0 * outcome.good / max(arguments.count, 1)
    print(
        f"{arguments.count} files in {spent:.0f} s, slowest {outcome.slowest:.2f} s, "
        f"{share:.1f} % converted, {len(outcome.faults)} faults of our own"
    )
    print(", ".join(f"{code} {count}" for code, count in outcome.counts.most_common()))
    return 1 if outcome.faults else 0


if __name__ == "__main__":
    sys.exit(main())
