"""CPU of surveys with one gross fault beside the clean survey, by number of photos.

    python tests/benchmarks/bench_faults.py                       # 9, 30, 100 photos
    python tests/benchmarks/bench_faults.py --photos 9 30 --only pick_60_400px
    python tests/benchmarks/bench_faults.py --photos 30 --only photo_mirrored --profile 40

A road flown there and back with a log (`tests/support/trust_world.py`): per photo 3.3 labels and
0.4 lengths; and with `--no-log` the same without one. Columns: seconds of CPU of `uavgram.run`
without outputs, their ratio to the clean survey's, and the exponent in photos since the row above.
"""

from __future__ import annotations

import argparse
import cProfile
import os
import pstats
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

from trust_conditions import CONDITIONS, World, draw
from trust_faults import FAULTS
from trust_world import write_survey

KINDS = ("swapped_once", "pick_60_400px", "length_percent", "photo_mirrored")
SEED = 39


def make_world(photos: int, *, log: bool) -> World:
    """Return a road of 18 m for each photo."""
    taped, marks, lengths = (round(share * photos) + 2 for share in (1.0, 2.3, 0.4))
    return replace(
        CONDITIONS["road_400m"],
        photos=photos,
        size_m=(18.0 * photos, 9.0),
        log="gps" if log else None,
        taped=(taped, taped),
        marks=(marks, marks),
        lengths=(lengths, lengths),
    )


def measure(world: World, fault: str, profiled: int) -> tuple[float, str]:
    """Return seconds of CPU of a run, and its verdict with its first cause."""
    import uavgram

    rng = np.random.default_rng(SEED)
    survey = draw(world, rng)
    if fault:
        FAULTS[fault].plant(survey, rng)
    with tempfile.TemporaryDirectory() as folder:
        project = write_survey(survey, Path(folder))
        profile = cProfile.Profile(time.process_time) if profiled else None
        start = time.process_time()
        try:
            call = profile.runcall if profile else lambda run, *a, **k: run(*a, **k)
            result = call(uavgram.run, project, output=None)
            first = result.verdict.reasons[0].cause if result.verdict.reasons else "-"
            found = f"{result.verdict.level} {first}"
        except uavgram.UavgramError as error:
            found = f"failed: {str(error)[:60]}"
        cpu_s = time.process_time() - start
    if profile:
        pstats.Stats(profile).sort_stats("cumulative").print_stats("uavgram", profiled)
    return cpu_s, found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--photos", nargs="+", type=int, default=[9, 30, 100])
    parser.add_argument("--only", nargs="+", default=KINDS)
    parser.add_argument("--no-log", action="store_true")
    parser.add_argument("--profile", type=int, default=0, help="lines of a profile of each run")
    given = parser.parse_args()
    measure(make_world(9, log=True), "swapped_once", 0)  # imports
    before: dict[str, tuple[int, float]] = {}
    for photos in given.photos:
        world = make_world(photos, log=not given.no_log)
        clean_s = 0.0
        for fault in ("", *given.only):
            cpu_s, found = measure(world, fault, given.profile)
            clean_s = clean_s or cpu_s
            exponent = ""
            if fault in before:
                fewer, less_s = before[fault]
                exponent = f"{np.log(cpu_s / less_s) / np.log(photos / fewer):.2f}"
            before[fault] = photos, cpu_s
            name = fault or "clean"
            row = f"{photos:4d} {name:16s} {cpu_s:7.2f} s {cpu_s / clean_s:5.2f} {exponent:>5s}"
            print(f"{row}  {found}", flush=True)


if __name__ == "__main__":
    main()
