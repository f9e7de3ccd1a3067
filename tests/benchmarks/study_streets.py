"""Free heights of the rendered streets against their truth.

Corners of cars and of a house are declared free in the three streets of the data folder
(UAVGRAM_DATA, else ../shared/data); the ground has a crown, kerbs, undulation and a bank. For each:

    z      root mean square of error over sigma
    >3s    share of errors beyond three sigmas, per cent: the bar is 1
    ratio  mean of |error| over mean sigma: the bar is 1.5
    none   without a value

    python tests/benchmarks/study_streets.py street_nadir street_oblique --redraw 10
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from height_errors import Errors
from street_data import free_street, picked_in, street_distances, street_heights

from uavgram.errors import UavgramError
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

STREETS = ("street_nadir", "street_oblique", "street_rolling")


def row(name: str, found: list[Errors]) -> str:
    """The table's line of one kind of errors."""
    error, sigma = (np.concatenate([getattr(f, key) for f in found]) for key in ("error", "sigma"))
    none = sum(len(one.without_value) for one in found)
    if not len(error):
        return f"  {name:10s} none of {none} has a value"
    z = error / sigma
    return (
        f"  {name:10s} {len(error):6d} {np.sqrt(np.mean(z**2)):6.2f} {np.abs(z).max():6.2f} "
        f"{100 * np.mean(np.abs(z) > 3):6.2f} {np.abs(error).mean() / sigma.mean():6.2f} "
        f"{np.median(np.abs(error)):6.3f} {np.median(sigma):6.3f} {none:6d}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("street", nargs="*", choices=[[], *STREETS])
    parser.add_argument("--redraw", type=int, default=0, help="draw the picks' noise so many times")
    parser.add_argument("--worst", type=int, default=0, help="so many, by name")
    given = parser.parse_args()
    root = Path(__file__).parents[3] / "shared" / "data"
    data = Path(os.environ.get("UAVGRAM_DATA", root))
    heads = ("number", "z", "most", ">3s", "ratio", "error", "sigma", "none")
    print(" " * 13 + " ".join(f"{head:>6s}" for head in heads))
    for name in given.street or STREETS:
        heights, distances, spent = [], [], []
        for seed in range(given.redraw) if given.redraw else [None]:
            with TemporaryDirectory(prefix="streets") as folder:
                street = free_street(data, name, Path(folder), redrawn=seed)
                start = time.process_time()
                try:
                    result = compute(read_inputs(street.project), curved=False).result
                except UavgramError as fault:
                    print(f"{name}: no result: {str(fault)[:300]}")
                    continue
                spent.append(time.process_time() - start)
                twice = len(picked_in(street, 2))
            heights.append(street_heights(street, result))
            distances.append(street_distances(street, result))
        if not heights:
            continue
        codes = sorted({m.code for m in result.messages if m.level != "info"})
        print(
            f"{name}: {len(street.free)} free, {twice} of them in two photos or more; "
            f"factor {result.solution.variance_factor:.2f}; cpu {np.mean(spent):.1f} s; "
            f"{', '.join(codes)}"
        )
        for kind, found in (("heights", heights), ("distances", distances)):
            print(row(kind, found), flush=True)
            z = np.abs(found[0].z)
            for i in np.argsort(-z)[: given.worst]:
                one = found[0]
                print(f"    {one.name[i]}: {one.error[i]:.3f} +- {one.sigma[i]:.3f}")


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
