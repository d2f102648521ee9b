"""Many parts for one cell: convert each, keep what is good, list what is not.

usage: python integrator.py CELL.toml OUT PART...
"""

import sys

import postproc as pp


def main(cell_file: str, out: str, *parts: str) -> int:
    """Return 0 when all parts became programs."""
    cell = pp.load_cell(cell_file)
    bad = 0
    for part in parts:
        try:
            job = pp.convert(part, cell)
        except pp.PostprocError as error:  # one bad file does not stop the others
            print(error)
            bad += 1
            continue
        if job.good:
            job.write(out)
        else:
            print(next(finding for finding in job.findings if finding.severity == "error"))
            bad += 1
    print(f"{len(parts) - bad} of {len(parts)} parts became programs")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
