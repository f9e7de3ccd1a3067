"""Make the tables of docs/accuracy.md from the data at hand.

Runs real photos with surveyed truth, digital twins, rendered streets and hostile surveys, compares
what comes out with the truth, and writes the tables into the page. The page's words, and the tables
of longer studies (each with its own command), stay as they are.

    python tests/benchmarks/make_accuracy.py
    python tests/benchmarks/make_accuracy.py flights --quick --print

Data are those of UAVGRAM_DATA, else ../shared/data.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from accuracy_tables import (
    HEIGHT_HEADS,
    LENGTH_HEADS,
    Compared,
    height_row,
    joined,
    length_row,
    markdown,
    replaced,
)
from flight_projects import copy_project
from height_errors import Errors
from published_projects import LENGTHS, board_project, duck_project, narrabeen_project
from published_scenes import narrabeen_targets, published, withheld
from street_data import free_street, street_distances, street_heights
from study_reality import study

import uavgram
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

PAGE = Path(__file__).parents[2] / "docs" / "accuracy.md"
SLOPE_DEG = 0.5
"""What is said of the slope of the beach: tests/end_to_end/test_published_scenes.py tells why."""

BARRELS_M = {"south": 20.26, "whole": 40.14}
"""Spacings by hand positions, good to 0.3 m, which is more than the program's own sigma."""
BARREL_SIGMA_M = 0.3

HOSTILE = {
    "clean": "nothing wrong",
    "real_mix": "what goes wrong in the field, all at once",
    "rough_5cm": "each point 5 cm off the plane",
    "shutter_40": "rolling shutter of 40 ms",
    "wrong_10cm": "one length wrong by 10 cm",
    "single": "single photo, nothing wrong",
}


@dataclass(frozen=True)
class Extent:
    """How much is run: every n-th scene of several, surveys of each hostile kind."""

    every: int
    surveys: int


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("section", nargs="*", choices=[[], *SECTIONS])
    parser.add_argument("--quick", action="store_true", help="fewer scenes, to try the command")
    parser.add_argument("--surveys", type=int, default=24, help="of each hostile kind")
    parser.add_argument("--print", action="store_true", help="leave the page as it is")
    given = parser.parse_args()
    data = Path(os.environ.get("UAVGRAM_DATA", Path(__file__).parents[3] / "shared" / "data"))
    extent = Extent(4, 4) if given.quick else Extent(1, given.surveys)
    for name in given.section or SECTIONS:
        made = SECTIONS[name](data, extent)
        print(made, flush=True)
        if not given.print:
            page = PAGE.read_text(encoding="utf-8")
            PAGE.write_text(replaced(page, name, made), encoding="utf-8")


def real_photos(data: Path, extent: Extent) -> str:
    """Published photos and a real flight: lengths that were not used, beside those surveyed."""
    rows = [length_row(one) for one in _published(data, extent)]
    return markdown(LENGTH_HEADS, rows)


def _published(data: Path, extent: Extent) -> Iterator[Compared]:
    beach = narrabeen_targets(data / "narrabeen_mavic")
    for kind, words in (("still", "one still"), ("video", "three video frames")):
        for count, known in ((1, "one known length"), (2, "two known lengths")):
            chosen = list(combinations(LENGTHS, count))[:: extent.every]
            some = [
                _withheld(partial(narrabeen_project, beach), kind, k, SLOPE_DEG) for k in chosen
            ]
            yield joined(f"beach at Narrabeen, {words}, {known}", some)
    duck = published(data / "cirn_duck")
    for ground in ("known heights", "rough ground"):
        some = [
            _withheld(partial(duck_project, duck), t, ground)
            for t in list(duck.point)[:: extent.every]
        ]
        yield joined(f"pier at Duck, one frame, one target left out, {ground}", some)
    board = published(data / "phantom3_lenscalib")
    for known in ("four corners", "six lengths between its corners", "six lengths of its rim"):
        some = [
            _withheld(partial(board_project, board), p, known)
            for p in sorted(board.pixels)[:: extent.every]
        ]
        yield joined(f"board on a floor, single photos, {known}", some)
    yield _barrels(data)


def _withheld(project: Callable[..., Path], *known: object) -> Compared:
    """The lengths that a project does not use; `project` takes a folder and what is known."""
    with TemporaryDirectory() as folder:
        relative, in_sigmas = withheld(uavgram.run(project(Path(folder), *known), output=None))
    # shares of each length: the true one is one
    return Compared("", relative, relative / in_sigmas, np.ones(len(relative)))


def _barrels(data: Path) -> Compared:
    measured = uavgram.run(data / "cuav" / "project.yaml", output=None).measurements
    rows = [measured.name.index(name) for name in BARRELS_M]
    true = np.array(list(BARRELS_M.values()))
    sigma = np.hypot(measured.sigma[rows], BARREL_SIGMA_M)
    words = "barrels under a plane, nine photos and a log (truth by hand, ± 0.3 m)"
    return Compared(words, measured.value[rows] - true, sigma, true)


def flights(data: Path, extent: Extent) -> str:
    """Digital twins: distances of flights of a real autopilot's code, beside the simulator's."""
    del extent
    rows = [length_row(_twin(data, *one)) for one in TWINS]
    return markdown(LENGTH_HEADS, rows)


TWINS = (
    ("calm_nadir", "flight.BIN", "from above, calm"),
    ("calm_nadir", "flight.tlog", "the same, log by radio"),
    ("wind_oblique", "flight.BIN", "tilted by 20° in wind, clock wrong by 4 s, a photo lost"),
    ("wind_oblique", "flight.tlog", "the same, log by radio"),
)


def _twin(data: Path, name: str, log: str, words: str) -> Compared:
    with TemporaryDirectory() as folder:
        project = copy_project(data / name, Path(folder), log=str(data / name / log))
        measured = uavgram.run(project, output=None).measurements
    truth = json.loads((data / "truth" / f"{name}.json").read_text(encoding="utf-8"))
    true = np.array([truth["measurements"][one] for one in measured.name])
    return Compared(words, measured.value - true, measured.sigma, true)


def streets(data: Path, extent: Extent) -> str:
    """Rendered streets with relief: heights of cars and a house, and distances from them."""
    rows = []
    for name, words in (("street_nadir", "from above"), ("street_oblique", "at 45°")):
        found: dict[str, list[Errors]] = {"heights": [], "distances": []}
        for redrawn in (None, *range(3))[:: extent.every]:
            with TemporaryDirectory() as folder:
                street = free_street(data, name, Path(folder), redrawn=redrawn)
                result = compute(read_inputs(street.project), curved=False).result
            found["heights"].append(street_heights(street, result))
            found["distances"].append(street_distances(street, result))
        rows += [height_row(_together(f"{words}: {key}", some)) for key, some in found.items()]
    return markdown(HEIGHT_HEADS, rows)


def _together(what: str, several: Sequence[Errors]) -> Compared:
    error, sigma = (
        np.concatenate([getattr(one, key) for one in several]) for key in ("error", "sigma")
    )
    return Compared(what, error, sigma, np.full(len(error), np.nan))


def hostile(data: Path, extent: Extent) -> str:
    """Hostile surveys of the kinds that say most."""
    del data
    rows = []
    for name, outcomes in study(list(HOSTILE), range(extent.surveys), {}, 1):
        good = [one for one in outcomes if not one.failure]
        relative, sigma = (
            np.concatenate([getattr(one, key) for one in good]) for key in ("error", "sigma")
        )
        lost = len(outcomes) - len(good)
        words = f"{HOSTILE[name]} ({len(outcomes)} surveys{f', {lost} failed' if lost else ''})"
        rows.append(length_row(Compared(words, relative, sigma, np.ones(len(relative)))))
    return markdown(LENGTH_HEADS, rows)


SECTIONS: dict[str, Callable[[Path, Extent], str]] = {
    "real photos": real_photos,
    "flights": flights,
    "streets": streets,
    "hostile": hostile,
}


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
