"""Which known things place one photo without a log, and how well distances are known then.

    python tests/benchmarks/study_one_photo.py --scenes 200

A lane of 3 to 10 m by 6 to 20 m somewhere in a photo from 15 to 40 m, tilted by 0 to 50 degrees;
lengths and widths to 1 cm, right angles and parallels to 0.3 degrees, picks to 0.7 px. Judged is
the distance of two other points within 10 m of the lane.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

from lanes import Lane, lane, measured, true_distance

from uavgram.errors import GeometryError
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

LENGTH, ACROSS = ("length", (0, 1)), ("length", (1, 2))
CORNERS = tuple(("right_angle", c) for c in ((0, 1, 2), (1, 2, 3), (2, 3, 0), (3, 0, 1)))
EDGES, ENDS = ("parallel", (0, 1, 3, 2)), ("parallel", (1, 2, 0, 3))
WIDTH = ("line_distance", (2, 0, 1))

KNOWN = {
    "length, right angle": (LENGTH, CORNERS[0]),
    "length, right angles at neighbouring corners": (LENGTH, *CORNERS[:2]),
    "length, right angles at opposite corners": (LENGTH, CORNERS[0], CORNERS[2]),
    "length, four right angles": (LENGTH, *CORNERS),
    "length, parallel edges, right angle": (LENGTH, EDGES, CORNERS[0]),
    "length, two pairs of parallels": (LENGTH, EDGES, ENDS),
    "length, two pairs of parallels, right angle": (LENGTH, EDGES, ENDS, CORNERS[0]),
    "two lengths, right angle between": (LENGTH, ACROSS, CORNERS[0]),
    "two lengths, parallel edges": (LENGTH, ACROSS, EDGES),
    "two lengths, parallel edges, right angle": (LENGTH, ACROSS, EDGES, CORNERS[0]),
    "two lengths, two pairs of parallels": (LENGTH, ACROSS, EDGES, ENDS),
    "lane's width, parallel edges, right angle": (WIDTH, EDGES, CORNERS[0]),
    "lane's width, parallel edges, length along": (WIDTH, EDGES, LENGTH),
    "lane's width, parallel edges, length along, right angle": (WIDTH, EDGES, LENGTH, CORNERS[0]),
    "area, four right angles": (("area", (0, 1, 2, 3)), *CORNERS),
}
"""What is known of a lane whose corners are 0 to 3, the edges 0-1 and 3-2."""

WITHIN = 3.3
"""Sigmas within which a distance is right: 0.1 % are not."""


class Placed(NamedTuple):
    """Of one scene: whether the reported distance is right, whether that of any pose is, and more.

    Attributes
    ----------
    first, among
        Of the best pose; of it or another that is reported beside it.
    error, sigma
        Of the right one, over the distance; of the first where none is.
    """

    first: bool
    among: bool
    error: float
    sigma: float


def placed(scene: Lane) -> Placed | None:
    """What comes of a scene; None where it is refused."""
    try:
        refined, _ = refine(scene.survey, SolveOptions(noise="stated"))
    except GeometryError:
        return None
    true = true_distance(scene)
    found = np.array([measured(one) for one in (refined.adjustment, *refined.alternatives)])
    right = np.abs(found[:, 0] - true) < WITHIN * found[:, 1]
    value, sigma = found[int(right.argmax())]
    return Placed(bool(right[0]), bool(right.any()), abs(value - true) / true, sigma / true)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=60)
    arguments = parser.parse_args()
    print("| known | placed | reported is right | right among those reported | error | sigma |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name, things in KNOWN.items():
        scenes = (lane(seed, noise=1.0) for seed in range(arguments.scenes))
        found = [placed(one.known(*things, noise=1.0)) for one in scenes]
        some = [one for one in found if one is not None]
        shares = [len(some) / len(found)]
        shares += [
            sum(column) / max(1, len(some))
            for column in ([p.first for p in some], [p.among for p in some])
        ]
        sizes = [
            float(np.median([getattr(p, key) for p in some])) if some else np.nan
            for key in ("error", "sigma")
        ]
        cells = [f"{100 * share:.0f} %" for share in shares] + [
            f"{100 * size:.1f} %" for size in sizes
        ]
        print("| " + " | ".join([name, *cells]) + " |", flush=True)


if __name__ == "__main__":
    main()
