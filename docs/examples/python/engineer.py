"""One part before the shift: convert it, look at the weakest tags, write program and page.

usage: python engineer.py PART CELL.toml OUT
"""

import sys

import numpy as np

import postproc as pp


def main(part: str, cell_file: str, out: str) -> int:
    """Return 0 when the program is good."""
    cell = pp.load_cell(cell_file)
    job = pp.convert(pp.read(part, cell), cell)
    print(job)
    for finding in job.findings:
        print(finding)
    if job.good:
        weakest = job.tags[np.argsort(job.tags["stiffness_N_per_mm"])[:5]]
        for tag in weakest:
            print(f"{tag['id']:>10}  {tag['stiffness_N_per_mm']:.0f} N/mm")
        job.write(out)
    job.report(f"{out}/{job.name}.html")
    return 0 if job.good else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
