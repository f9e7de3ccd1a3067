"""Proposals of the picking page in rendered streets against their truth, with and without the log.

All points that one photo shows are picked there, and some lengths between them are known. What the
page then proposes in the other photos, before anything is accepted, is compared with the truth.

    found   share of pairs (point, other photo that shows it) that are proposed, per cent
    rms     of the error of a coordinate [px], of those that are not wrong
    wrong   beyond 3 px, number and per cent of the proposals
    sure    proposals that one click accepts unseen, and how many of these are wrong

    python tests/benchmarks/study_proposals.py [--photos 2] [--log] [--raised] [--accept]

The streets are those of the data folder (UAVGRAM_DATA, else ../shared/data). `--raised` picks
corners of cars and walls as well, their heights left blank as by a person who does not know that
they matter; `--accept` accepts the sure ones and lets the page search once more.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import sys
import time
from collections import defaultdict
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import cv2
import numpy as np
from flight_projects import copy_project

from uavgram.errors import UavgramError
from uavgram.picking.document.history import apply_change
from uavgram.picking.document.proposals import (
    Outcomes,
    Pair,
    make_accept_command,
    select_certain,
)
from uavgram.picking.document.state import State, make_state
from uavgram.picking.session.point_search import SearchInput
from uavgram.picking.session.searches import Searches
from uavgram.picking.session.workers import collect_observations
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey

STREETS = ("street_nadir", "street_oblique", "street_rolling")
WRONG_PX, NOISE_PX = 3.0, 0.8
SHORTEST_M, LONGEST_M, APART_PX = 4.0, 20.0, 80.0
RAISED_M = 0.02

Truth = dict[str, Any]
Shown = dict[str, tuple[float, float]]


def shown_in(truth: Truth, photo: str, *, raised: bool) -> Shown:
    """Pixels of the points that a photo shows, in order of their labels."""
    above = truth["height_above_ground_m"]
    return {
        label: (u, v)
        for label, (u, v, visible) in sorted(truth["pixels"][photo].items())
        if visible
        and label in above
        and "_" not in label
        and label[0] in ("PQZDRVW" if raised else "PQZDR")
        and (label[0] in "VW" or abs(above[label]) < RAISED_M)
    }


def choose_lengths(truth: Truth, shown: Shown, count: int) -> list[tuple[str, str]]:
    """Pairs of points on the ground, apart from each other, that a person could have taped."""
    chosen: list[tuple[str, str]] = []
    for ends in combinations((label for label in shown if label[0] in "RPQ"), 2):
        among = [shown[label] for pair in (*chosen, ends) for label in pair]
        apart = all(math.dist(a, b) > APART_PX for a, b in combinations(among, 2))
        if apart and SHORTEST_M < math.dist(*(truth["points"][one] for one in ends)) < LONGEST_M:
            chosen.append(ends)
        if len(chosen) == count:
            break
    return chosen


def write_project(
    data: Path, truth: Truth, folder: Path, photo: str, given: argparse.Namespace
) -> Path:
    """Write the picks of one photo, and the lengths."""
    shown = shown_in(truth, photo, raised=given.raised)
    lengths = choose_lengths(truth, shown, given.lengths)
    picks = [["image", "label", "u_px", "v_px", "sigma_px"]]
    picks += [[photo, one, f"{u:.3f}", f"{v:.3f}", str(NOISE_PX)] for one, (u, v) in shown.items()]
    lines = [["name", "from", "to", "length_m", "sigma_m"]]
    for k, (a, b) in enumerate(lengths):
        length = math.dist(truth["points"][a], truth["points"][b])
        lines.append([f"L{k}", a, b, f"{length:.3f}", "0.01"])
    folder.mkdir(parents=True)
    for name, rows in {"picks": picks, "lines": lines}.items():
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(rows)
    files: dict[str, object] = {name: str(folder / f"{name}.csv") for name in ("picks", "lines")}
    without = {} if given.log else {"log": None, "time": None}
    return copy_project(data, folder, **files, measure=None, control=None, check=None, **without)


def adjust(survey: LiveSurvey, state: State) -> LiveAdjustment | None:
    """Adjust as the page does; None where that is not possible yet."""
    try:
        return survey.adjust(collect_observations(state))
    except UavgramError as why:
        print(f"  not adjusted: {str(why)[:150]}")
        return None


def proposed(project: Path, *, accept: bool = False) -> Outcomes:
    """What the page proposes in the end, or once the sure ones are accepted."""
    survey = LiveSurvey.open(project)
    state = make_state(survey.inputs.picks, survey.inputs.lines, survey.inputs.requests)
    searches = Searches(survey, lambda *_: None, lambda _: None)
    wanted = SearchInput(state, adjust(survey, state), is_adjusted=True)
    searches._seeker.submit(wanted)
    searches._seeker._seek(wanted)
    sure = select_certain(searches.outcomes)
    if accept and sure:
        more = make_accept_command(searches.outcomes, state, sorted(sure))
        state = apply_change(state, more)
        again = SearchInput(state, adjust(survey, state), is_adjusted=True)
        searches._seeker.submit(again)
        searches._seeker._seek(again)
    return searches.outcomes


def compare(truth: Truth, photo: str, outcomes: Outcomes, *, raised: bool) -> dict[str, Any]:
    """Count pairs, and errors of proposals, by kind of point."""
    labels = shown_in(truth, photo, raised=raised)
    sure = select_certain(outcomes)
    rows: dict[str, list[Any]] = defaultdict(list)
    for other, sights in truth["pixels"].items():
        for label, (u, v, visible) in sights.items():
            if label not in labels or other == photo:
                continue
            pair: Pair = (other, label)
            found = outcomes[pair].found if pair in outcomes else None
            off = math.inf if found is None else math.dist((found.u_px, found.v_px), (u, v))
            if visible or found is not None:
                rows[kind_of(label)].append((bool(visible), off, pair in sure, pair))
    return rows


def kind_of(label: str) -> str:
    return "cars and walls" if label[0] in "VW" else "ground"


def line(name: str, rows: list[tuple[bool, float, bool, Pair]]) -> str:
    """Describe some pairs."""
    visible = sum(seen for seen, *_ in rows)
    off = np.array([one for _, one, *_ in rows if math.isfinite(one)])
    good = off[off <= WRONG_PX]
    certain = [one for _, one, is_sure, _ in rows if is_sure]
    return (
        f"{name:32s} {visible:6d} {100 * len(good) / max(visible, 1):6.1f} "
        f"{np.sqrt(np.mean(good**2) / 2) if len(good) else np.nan:6.3f} "
        f"{len(off) - len(good):5d} {100 * (len(off) - len(good)) / max(len(off), 1):6.2f} "
        f"{len(certain):6d} {sum(one > WRONG_PX for one in certain):5d}"
    )


def chosen_photos(truth: Truth, count: int, *, raised: bool) -> list[str]:
    """Some photos, evenly spread over the flight."""
    names = sorted(one for one in truth["pixels"] if len(shown_in(truth, one, raised=raised)) >= 8)
    return [names[k] for k in np.linspace(0, len(names) - 1, count + 2).astype(int)[1:-1]]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--photos", type=int, default=2, help="photos with picks, one at a time")
    parser.add_argument("--lengths", type=int, default=4)
    parser.add_argument("--log", action="store_true")
    parser.add_argument("--raised", action="store_true")
    parser.add_argument("--accept", action="store_true", help="search again with the sure ones")
    parser.add_argument("--only", nargs="*", default=STREETS)
    parser.add_argument("--worst", type=int, default=8)
    given = parser.parse_args()
    cv2.setNumThreads(1)
    data = Path(os.environ.get("UAVGRAM_DATA", Path(__file__).parents[3] / "shared" / "data"))
    heads = ("pairs", "found", "rms", "wrong", "%", "sure", "wrong")
    print(" " * 33 + " ".join(f"{head:>6s}" for head in heads))
    together: dict[str, list[Any]] = defaultdict(list)
    for street in given.only:
        truth = json.loads((data / "truth" / f"{street}.json").read_text(encoding="utf-8"))
        for photo in chosen_photos(truth, given.photos, raised=given.raised):
            start = time.process_time()
            with TemporaryDirectory(prefix="proposals") as work:
                project = write_project(data / street, truth, Path(work) / "p", photo, given)
                outcomes = proposed(project, accept=given.accept)
            for kind, rows in compare(truth, photo, outcomes, raised=given.raised).items():
                print(line(f"{street} {photo} {kind}", rows), flush=True)
                together[kind] += [(*row[:3], (street, *row[3])) for row in rows]
            print(f"  cpu {time.process_time() - start:.1f} s", flush=True)
    tell(together, given.worst)


def tell(together: dict[str, list[Any]], worst: int) -> None:
    """Print the sums, and the proposals that are most wrong."""
    for kind, rows in together.items():
        print(line(f"all, {kind}", rows))
    every: Iterable[Any] = (row for rows in together.values() for row in rows)
    ranked = sorted((row for row in every if math.isfinite(row[1])), key=lambda row: -row[1])
    for _, off, is_sure, pair in ranked[:worst]:
        print(f"  {' '.join(pair)}: {off:.2f} px{', sure' if is_sure else ''}")


if __name__ == "__main__":
    main()
