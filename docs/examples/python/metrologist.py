"""Why are the holes off? Diagnose a campaign, keep the model, say what it promises elsewhere.

usage: python metrologist.py MEASURED.csv CELL.toml OUT [OTHER_POSES.csv]
"""

import sys

import postproc as pp


def main(measured: str, cell_file: str, out: str, other: str = "") -> int:
    """Return 0 when the gap is explained or there is none."""
    cell = pp.load_cell(cell_file)
    job = pp.diagnose(measured, cell)
    for line in job.summary:
        print(line)
    job.write(out)
    if other:
        before, after = (pp.predict(other, cell, model).rms * 1e3 for model in (None, job.model))
        print(f"other poses: {before:.3f} mm off without the model, {after:.3f} mm with it")
    return 0 if job.verdict in ("explained", "no_gap") else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
