"""How well the matching kernel finds points of the rendered streets, truth being known.

Each point is picked without noise in one photo and sought in all others, with poses that err by
3 cm and 0.05 degrees (as an adjustment leaves them) or by 1 m and 1 degree (telemetry).

    python tests/benchmarks/study_matching_kernel.py street_nadir street_rolling --poses after
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from street_pairs import AFTER, BEFORE, PoseError, StreetTruth

from uavgram.imaging.matching.least_squares import MatchOptions, RefusalReason
from uavgram.imaging.matching.match import match_points
from uavgram.model.arrays import Bools, Floats, Ints

STREETS = ("street_nadir", "street_rolling", "street_oblique")
POSES = {"after": AFTER, "before": BEFORE}
REPEATED = ("corner of a lane marking", "corner of the zebra", "Z", "D")
WRONG_PX = 3.0


class Outcome(NamedTuple):
    """Of n sought points: error, its covariance, why refused, what it was."""

    label: list[str]
    error_px: Floats
    covariance_px2: Floats
    score: Floats
    refused: Ints
    seconds: float

    @property
    def found(self) -> Bools:
        return np.asarray(self.refused == RefusalReason.NONE)


def outcome(
    street: StreetTruth, labels: set[str], error: PoseError, seed: int, options: MatchOptions
) -> Outcome:
    """All pairs of a street."""
    rng = np.random.default_rng(seed)
    photos = {frame: street.photo(frame) for frame in street.frames}
    names, rows, spent = [], [], 0.0
    for pair in street.pairs(labels, error, rng):
        start = time.process_time()
        found = match_points(photos[pair.source], photos[pair.target], pair.sought, options)
        spent += time.process_time() - start
        names += [f"{pair.source[4:8]}-{pair.target[4:8]} {label}" for label in pair.label]
        rows.append(
            (
                found.pixel_px - pair.true_px,
                found.covariance_px2,
                found.score,
                found.refused,
            )
        )
    columns = [np.concatenate(column) for column in zip(*rows, strict=True)]
    miss, covariance, score, refused = columns
    return Outcome(names, miss, covariance, score, refused, spent)


def line(name: str, of: Outcome, chosen: Bools) -> str:
    """A row of the table."""
    found = of.found & chosen
    error, covariance = of.error_px[found], of.covariance_px2[found]
    size = np.hypot(*error.T)
    wrong = size > WRONG_PX
    right = error[~wrong]
    weight = np.linalg.inv(covariance[~wrong])
    z = np.sqrt(np.einsum("ni,nij,nj->n", right, weight, right) / 2)
    why = Counter(RefusalReason(r).name for r in of.refused[chosen & ~of.found])
    return (
        f"{name:28s} {chosen.sum():6d} {100 * found.sum() / max(chosen.sum(), 1):6.1f} "
        f"{np.sqrt(np.mean(right**2)):6.3f} {np.sqrt(np.mean(z**2)):6.2f} "
        f"{z.max(initial=0.0):6.1f} {wrong.sum():4d} {1e3 * of.seconds / len(of.label):5.1f}  "
        + " ".join(f"{key} {value}" for key, value in why.most_common())
    )


def groups(street: StreetTruth, labels: Iterable[str]) -> dict[str, Bools]:
    """Which of the sought points are of which kind."""
    kinds = [street.truth["kinds"][label.split()[1]] for label in labels]
    own = [label.split()[1][0] for label in labels]
    repeated = np.array([kind in REPEATED for kind in kinds])
    natural = np.array([first in "PQ" for first in own]) & ~repeated
    found = {"natural": natural, "repeated": repeated}
    for first, name in (
        ("R", "discs"),
        ("G", "chequers"),
        ("V", "cars"),
        ("W", "walls"),
        ("M", "moving"),
    ):
        found[name] = np.array([letter == first for letter in own])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "street", nargs="*", default=list(STREETS), help="or folders of flights rendered by tests"
    )
    parser.add_argument("--poses", nargs="*", choices=list(POSES), default=list(POSES))
    parser.add_argument(
        "--kinds",
        default="PRG",
        help="first letters of the labels; of rendered flights P Q Z D are ground",
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds-apart", action="store_true", help="a row for each kind of thing")
    parser.add_argument("--wrong", action="store_true", help="name those that are wrong")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    root = Path(__file__).parents[3] / "shared" / "data"
    data = Path(os.environ.get("UAVGRAM_DATA", root))
    heads = ("sought", "found%", "rms", "z", "most z", "wrong", "ms")
    print(" " * 28 + " ".join(f"{head:>6s}" for head in heads))
    for name in given.street:
        street = (
            StreetTruth.read(data, name) if name in STREETS else StreetTruth.rendered(Path(name))
        )
        labels = {label for label in street.truth["kinds"] if label[0] in given.kinds}
        for poses in given.poses:
            of = outcome(street, labels, POSES[poses], given.seed, MatchOptions())
            print(f"{name}, poses {poses} an adjustment")
            kinds = [street.truth["kinds"][label.split()[1]] for label in of.label]
            for group, chosen in groups(street, of.label).items():
                if chosen.any():
                    print(line("  " + group, of, chosen))
            for kind in sorted(set(kinds)) if given.kinds_apart else ():
                print(line("    " + kind, of, np.array([own == kind for own in kinds])))
            if given.wrong:
                for i in np.flatnonzero(of.found & (np.hypot(*of.error_px.T) > WRONG_PX)):
                    print(
                        "   ", of.label[i], kinds[i], of.error_px[i].round(1), of.score[i].round(2)
                    )


if __name__ == "__main__":
    main()
