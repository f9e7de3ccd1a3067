"""Things that look like their neighbours: found where the prediction can tell them apart, else not?

Corners of zebra stripes and of dashes in rendered streets (tests/support/streets), each sought in
other photos by poses that are more or less wrong. A prediction may tell a stripe from the next one
where its region (99.9 %) ends before half the period, in the direction of the repetition.

    below, above  the region ends before half the period, or reaches farther
    one period    the region holds the neighbour itself, all of it
    pairs         points in photos that show them
    found         share of these, per cent
    wrong         beyond 3 px, of those found; per cent of them
    a period off  of these, those that are where a neighbour is

    python tests/benchmarks/study_matching.py --only 0 1 --seed 8800 --folder /tmp/streets
    python tests/benchmarks/study_repeated.py /tmp/streets/m0 /tmp/streets/m1
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import cv2
import numpy as np
from street_pairs import Pair, PoseError, StreetTruth

from uavgram.imaging.matching.least_squares import RefusalReason
from uavgram.imaging.matching.match import REGION, match_points
from uavgram.model.arrays import Bools, Floats

PERIOD_M = {"Z": 1.0, "D": 5.0}
NEAR_M, WRONG_PX = 0.03, 3.0
POSES = tuple(
    PoseError.of(metres, degrees)
    for metres, degrees in ((0.03, 0.05), (0.1, 0.1), (0.2, 0.3), (0.5, 0.5), (1.0, 1.0))
)


class Outcome(NamedTuple):
    """Of n sought points: their kind, whether found, error, of how far the region reaches.

    `reach` is the region's in the direction of the repetition, in periods; `off` the error
    (n, 2) [px], `beside` (n, 4) by how much (two each) the neighbours lie away [px].
    """

    kind: list[str]
    found: Bools
    off: Floats
    reach: Floats
    beside: Floats


def neighbours(street: StreetTruth) -> dict[str, list[str]]:
    """Of each label, those that are one period away."""
    place = {k: np.array(p) for k, p in street.truth["points"].items() if k[0] in PERIOD_M}
    return {
        one: [
            other
            for other, there in place.items()
            if other[0] == one[0] and abs(np.linalg.norm(here - there) - PERIOD_M[one[0]]) < NEAR_M
        ]
        for one, here in place.items()
    }


def looked_at(street: StreetTruth, error: PoseError, share: float, seed: int) -> list[Outcome]:
    """Outcomes of some pairs of photos."""
    rng = np.random.default_rng(seed)
    beside = neighbours(street)
    labels = {label for label, others in beside.items() if others}
    photos = {frame: street.photo(frame) for frame in street.frames}
    done = []
    for pair in street.pairs(labels, error, rng):
        if rng.random() > share:
            continue
        found = match_points(photos[pair.source], photos[pair.target], pair.sought)
        reach, away = _periods(street, pair, beside)
        done.append(
            Outcome(
                kind=[label[0] for label in pair.label],
                found=np.asarray(found.refused == RefusalReason.NONE),
                off=found.pixel_px - pair.true_px,
                reach=reach,
                beside=away,
            )
        )
    return done


def _periods(
    street: StreetTruth, pair: Pair, beside: dict[str, list[str]]
) -> tuple[Floats, Floats]:
    """(n,) how many periods the region reaches, (n, 4) ways to the neighbours; NaN: unseen."""
    pixels = street.truth["pixels"][pair.target]
    away = np.full((len(pair.label), 2, 2), np.nan)
    for i, label in enumerate(pair.label):
        for k, other in enumerate(o for o in beside[label] if o in pixels):
            away[i, min(k, 1)] = np.array(pixels[other][:2]) - pair.true_px[i]
    inverse = np.linalg.inv(pair.sought.covariance_px2)
    squared = np.einsum("nki,nij,nkj->nk", away, inverse, away)
    with np.errstate(invalid="ignore"):
        nearest = np.where(np.isfinite(squared), squared, np.inf).min(axis=1)
    return np.sqrt(REGION / nearest), away.reshape(-1, 4)


def told(name: str, of: list[Outcome], lowest: float, highest: float) -> None:
    """Print a line for each kind."""
    for kind in PERIOD_M:
        rows = [np.array([k == kind for k in o.kind]) & (o.reach > 0) for o in of]
        rows = [
            r & (o.reach >= lowest) & (o.reach < highest) for r, o in zip(rows, of, strict=True)
        ]
        total = sum(int(r.sum()) for r in rows)
        if not total:
            continue
        found = np.concatenate([o.found[r] for r, o in zip(rows, of, strict=True)])
        off = np.concatenate([o.off[r] for r, o in zip(rows, of, strict=True)])
        beside = np.concatenate([o.beside[r] for r, o in zip(rows, of, strict=True)])
        wrong = found & (np.hypot(*off.T) > WRONG_PX)
        gaps = np.linalg.norm(beside.reshape(-1, 2, 2) - off[:, None], axis=2)
        taken = wrong & (np.nan_to_num(gaps, nan=np.inf).min(axis=1) < WRONG_PX)
        word = {"Z": "zebra", "D": "dashes"}[kind]
        print(
            f"{name:12s} {word:7s} {total:6d} {100 * found.mean():6.1f} {int(wrong.sum()):5d} "
            f"{100 * wrong.sum() / max(found.sum(), 1):6.2f} {int(taken.sum()):5d}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("street", nargs="+", help="folders with photos and truth.json")
    parser.add_argument("--share", type=float, default=0.35, help="of the pairs of photos")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    cv2.setNumThreads(1)
    done: list[Outcome] = []
    print(f"{'':20s} {'pairs':>6s} {'found':>6s} {'wrong':>5s} {'%':>6s} a period off")
    for folder in given.street:
        street = StreetTruth.rendered(Path(folder))
        for number, error in enumerate(POSES):
            done += looked_at(street, error, given.share, given.seed + number)
        print(folder)
        told("below", done, 0.0, 0.5)
        told("above", done, 0.5, 1.0)
        told("one period", done, 1.0, np.inf)


if __name__ == "__main__":
    main()
