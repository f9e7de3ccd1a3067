"""How long it takes to find which of 450 camera events 400 photos are, the clock unknown.

python tests/benchmarks/bench_alignment.py
"""

from __future__ import annotations

import time

import numpy as np

from uavgram.estimation.clocks.alignment import align

PHOTOS, EVENTS, OFFSET_S, REPEATS = 400, 450, 36000.3, 5

if __name__ == "__main__":
    rng = np.random.default_rng(11)
    event = 1.7e9 + np.cumsum(rng.uniform(1.0, 6.0, EVENTS))
    for resolution in (0.001, 1.0):
        photo = np.floor((event[:PHOTOS] + OFFSET_S) / resolution) * resolution
        spent = []
        for _ in range(REPEATS):
            started = time.process_time()
            found = align(photo, resolution, event)
            spent.append(time.process_time() - started)
        print(
            f"{PHOTOS} photos of {resolution:g} s resolution, {EVENTS} events: "
            f"{1e3 * min(spent):.0f} ms, unique {found.unique}, "
            f"offset {found.clock.offset_s - OFFSET_S:+.4f} s off"
        )
