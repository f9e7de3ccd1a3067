"""Damage a log in many ways and read each: run by test_flight_log.py in processes of its own.

    python mutated_logs.py SOURCE SUFFIX FIRST_SEED COUNT

prints a JSON object: how many were read and refused, the slowest reading, the growth of memory,
and what went wrong (an error that is none of ours, an implausible value), with the seed.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import TypedDict

import numpy as np
from log_mutants import BYTES, mutant
from numpy.typing import ArrayLike

from uavgram.errors import UavgramError
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.model.flight_log import Boot, BootSummary, LogSummary
from uavgram.stages.log_summary import summarise_log

Demand = tuple[str, ArrayLike]
"""What is asked of a log, and whether it is so, value by value."""


class Tally(TypedDict):
    """What the process prints."""

    read: int
    refused: int
    slowest_s: float
    wrong: list[str]
    growth_bytes: int


def mutated(suffix: str, data: bytes, seed: int) -> bytes:
    """Damage of a kind that the form of log can have, and up to two more of its bytes, by the seed.

    The first is often of values, rows or formats that are read: what a checksum does not cover.
    """
    rng = np.random.default_rng(seed)
    damaged = mutant(suffix, data, seed)[1]
    for _ in range(int(rng.integers(0, 3))):
        if len(damaged) < 2:
            break
        damaged = BYTES[int(rng.integers(0, len(BYTES)))](damaged, rng)
    return damaged


def check(summary: LogSummary) -> list[str]:
    """Say what of a log that was read is not plausible; an empty list where all is."""
    undulation = summary.log.undulation_m
    demands: list[Demand] = [("undulation", not np.isfinite(undulation) or abs(undulation) < 150)]
    for part in summary.boots:
        demands += [*of_track(part), *of_angles(part.boot), *of_events(part.boot)]
        if (clock := part.clock) is not None:
            demands.append(("drift", abs(clock.rate - 1) < 3e-3))
            demands.append(("clock", 1.2e9 < clock.offset_s < 3.6e9))
            demands.append(("sigma of the clock", 0 < clock.sigma_s < 1))
    return [what for what, truth in demands if not np.all(truth)]


def of_track(part: BootSummary) -> Iterator[Demand]:
    """Where, how fast, how well known."""
    if (p := part.boot.positions) is not None:
        step = np.diff(p.time_boot_s)
        yield "latitude", np.abs(p.latitude_deg) <= 90
        yield "longitude", np.abs(p.longitude_deg) <= 180
        yield "height", np.abs(p.height_m) < 20000
        yield "times of positions", (step > 0) & (p.time_boot_s[-1] < 30 * 86400)
        run = np.linalg.norm(np.diff(part.track_m, axis=0), axis=1)
        yield "speed", run < 5 * (60 + 200 * np.minimum(step, 20) * 4)
    if (s := part.boot.sigmas) is not None:
        for values in (s.horizontal_m, s.vertical_m):
            yield "sigma", np.isnan(values) | ((values > 0) & (values < 1000))
    if (h := part.boot.home) is not None:
        yield "home", (np.abs(h.latitude_deg) <= 90) & (np.abs(h.height_m) < 20000)


def of_angles(boot: Boot) -> Iterator[Demand]:
    """How it was turned."""
    if (a := boot.attitudes) is not None:
        yield "attitude", np.abs(np.linalg.norm(a.ned_from_body_xyzw, axis=1) - 1) < 1e-6
        yield "times of attitudes", np.diff(a.time_boot_s) > 0
    if (g := boot.gimbal) is not None:
        angles = np.c_[g.roll_rad, g.pitch_rad, g.yaw_rad]
        yield "gimbal", np.abs(angles) <= np.radians(361)


def of_events(boot: Boot) -> Iterator[Demand]:
    """When it took photos."""
    if (e := boot.events) is not None:
        yield "times of events", (np.diff(e.time_boot_s) > 0) & (e.time_boot_s[0] >= 0)
        yield "image numbers", (e.image_number >= -1) & (e.image_number < 1e6)


def peak_bytes() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def examine(source: str, suffix: str, first_seed: int, count: int) -> Tally:
    """Read `count` damaged forms of one log."""
    data = Path(source).read_bytes()
    tally = Tally(read=0, refused=0, slowest_s=0.0, wrong=[], growth_bytes=0)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"log{suffix}"
        path.write_bytes(data)
        summarise_log(read_flight_log(path, positions_needed=False))
        base = peak_bytes()
        for seed in range(first_seed, first_seed + count):
            path.unlink()  # to cut a written file short waits for the disk
            path.write_bytes(mutated(suffix, data, seed))
            start = time.perf_counter()
            try:
                summary = summarise_log(read_flight_log(path, positions_needed=False))
                tally["read"] += 1
                tally["wrong"] += [f"seed {seed}: {w}" for w in check(summary)]
            except UavgramError:
                tally["refused"] += 1
            except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
                at = traceback.extract_tb(error.__traceback__)[-1]
                place = f"{Path(at.filename).name}:{at.lineno}"
                tally["wrong"].append(f"seed {seed}: {type(error).__name__} in {place}: {error}")
            tally["slowest_s"] = max(tally["slowest_s"], time.perf_counter() - start)
    tally["growth_bytes"] = peak_bytes() - base
    return tally


if __name__ == "__main__":
    source, suffix, first_seed, count = sys.argv[1:]
    sys.stdout.write(json.dumps(examine(source, suffix, int(first_seed), int(count))))
