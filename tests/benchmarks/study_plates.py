"""Four coded plates and nothing else: are the distances that they give honest?

Fresh flights over a road, with a flight log and without, each with four plates; their corners are
seen with the noise that the fit of their pictures leaves, and withheld points are picked by hand.

    z      root mean square of error over sigma of all withheld distances: 0.8 to 1.2
    >4s    number beyond four sigmas: 0
    error  median of |error| / distance

    nice python tests/benchmarks/study_plates.py --flights 50
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from plate_flights import plate_flight

import uavgram
from uavgram.errors import UavgramError


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--flights", type=int, default=50)
    parser.add_argument("--first", type=int, default=1000, help="seed of the first flight")
    given = parser.parse_args()
    for log in (True, False):
        error, sigma, distance, failed = [], [], [], 0
        started = time.perf_counter()
        for seed in range(given.first, given.first + given.flights):
            with TemporaryDirectory() as folder:
                flight = plate_flight(Path(folder), seed, log=log)
                try:
                    found = uavgram.run(flight.project, output=None).measurements
                except UavgramError as why:
                    failed += 1
                    sys.stdout.write(f"flight {seed}: {why}\n")
                    continue
            true = np.array([flight.truth[name] for name in found.name])
            error += (found.value - true).tolist()
            sigma += found.sigma.tolist()
            distance += true.tolist()
            z = np.array(error) / sigma
            sys.stdout.write(
                f"{'log' if log else 'no log'} {seed - given.first + 1}: n {len(z)}  "
                f"z {np.sqrt(np.mean(z**2)):.3f}  "
                f"worst {np.abs(z).max():.2f}  >4s {(np.abs(z) > 4).sum()}  error "
                f"{np.median(np.abs(error) / np.array(distance)):.5f}  failed {failed}  "
                f"{(time.perf_counter() - started) / (seed - given.first + 1):.1f} s each\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
