"""Matches of picks in rendered streets against their truth: `uavgram picks match`, whole.

Each point is picked in one photo and looked for in all others. Streets of tests/support/streets,
each of its own seed: nothing was tuned on them.

    found   share of pairs (point, photo that shows it) that were found, per cent
    rms     of the error of a coordinate [px], of those that are not wrong
    z       root mean square of error over stated sigma, of those
    wrong   beyond 3 px, per cent of those accepted; of points that the photo hides: hidden

Then the same with 0.8 px of noise in every pick: distances between the things meant.

    python tests/benchmarks/study_matching.py --flights 6 --seed 700 --json matching.json

`--shared DRAW` takes the three rendered streets of the data folder (UAVGRAM_DATA, else
../shared/data) instead, each point picked exactly in its best photo (0), or in one drawn by chance
(1, 2...). The gimbal of street_rolling is logged wrong by 15 degrees: it has tie points.

`--blank` leaves the heights of corners of cars and walls blank, as a person may who does not know
that they matter; otherwise they are `free`.

`--picked two` picks each point of the shared streets in the first two photos that show it instead;
`first`, `three`, `middle` and `last` likewise, several after each other. `--in-photo` picks in the
first (...) photos of the flight only, `--noise` adds click noise [px], `--no-log` takes the log
away.

    python tests/benchmarks/study_matching.py --shared 0 --blank --picked first two middle last
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import cv2
import numpy as np
from flight_projects import copy_project
from streets.flight import Kind
from streets.street import Street, Wish, draw_street
from streets.writing import Tables, picked, truth, write_street

from uavgram.errors import UavgramError
from uavgram.model.arrays import Floats
from uavgram.pipeline.match.run import match_picks
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.picks_table import write_ties

FLIGHTS: tuple[tuple[Kind, float], ...] = (
    ("nadir", 0.0),
    ("oblique", 0.0),
    ("nadir", 0.03),
    ("oblique", 0.03),
    ("orbit", 0.0),
)
HEIGHTS_M = (30.0, 40.0, 50.0)
WRONG_PX, NOISE_PX = 3.0, 0.8
OFF_GROUND = "VW"
FOOT_M = 0.05  # up to which a corner stands on the ground
SHARED = ("street_nadir", "street_oblique", "street_rolling")
PICKED: dict[str, Callable[[list[str]], list[str]]] = {
    "first": lambda photos: photos[:1],
    "two": lambda photos: photos[:2],
    "three": lambda photos: photos[:3],
    "middle": lambda photos: photos[len(photos) // 2 :][:1],
    "last": lambda photos: photos[-1:],
}


@dataclass(frozen=True)
class Pair:
    """A point in a photo that shows it and in which it was not picked; NaN where not found."""

    flight: str
    photo: str
    label: str
    visible: bool
    du: float
    dv: float
    sigma: float


def study_street(index: int, seed: int) -> Street:
    """The street of a flight."""
    kind, readout = FLIGHTS[index % len(FLIGHTS)]
    wish = Wish(
        kind=kind, height_m=HEIGHTS_M[index % len(HEIGHTS_M)], readout_s=readout, natural=120
    )
    return draw_street(seed + index, wish)


def run(index: int, seed: int, kept: str | None, height: str) -> dict[str, Any]:
    """One flight: pairs of the exact picks, distances of the noisy ones, seconds."""
    cv2.setNumThreads(1)
    street = study_street(index, seed)
    kind, readout = FLIGHTS[index % len(FLIGHTS)]
    name = f"{kind} {1e3 * readout:.0f} ms"
    with TemporaryDirectory(prefix="matching") as temporary:
        folder = Path(kept or temporary) / f"m{index}"
        start = time.process_time()
        pairs = _matched(street, folder, 0.0, name, height)
        spent = time.process_time() - start
        distances = _distances(street, folder, name, height)
    return {"flight": name, "pairs": pairs, "distances": distances, "seconds": spent}


def _write(street: Street, folder: Path, noise_px: float, height: str) -> Path:
    """The project: every point in one photo, lengths between discs."""
    rng = np.random.default_rng((3, street.seed))
    # A person's sigma in any case: that a pick is exact is not known to the program.
    place = dict(zip(street.label, street.point, strict=True))
    picks = picked(street, "PQZDVWRG", 1, noise_px, rng)
    free = {p.label for p in picks if p.label[0] in OFF_GROUND}
    there = [p.label for p in picks if p.label[0] == "R"]
    lengths = [
        (a, b, float(np.linalg.norm(place[a] - place[b]) + 0.01 * rng.normal()), 0.01)
        for a, b in pairwise(there)
    ]
    natural = [p.label for p in picks if p.label[0] == "P"]
    distances = list(zip(natural[0::2], natural[1::2], strict=False))
    project = write_street(
        street, folder, Tables(picks=picks, lengths=lengths, distances=distances)
    )
    table = folder / "picks.csv"
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    with table.open("w", newline="") as file:
        writer = csv.DictWriter(file, [*rows[0], "height_m"])
        writer.writeheader()
        for row in rows:
            own = height if row["label"] in free else ""
            writer.writerow(row | {"sigma_px": str(NOISE_PX), "height_m": own})
    return project


def _matched(street: Street, folder: Path, noise_px: float, flight: str, height: str) -> list[Pair]:
    return _found(_write(street, folder, noise_px, height), truth(street)["pixels"], flight)


def _found(project: Path, true_pixels: Mapping[str, Any], flight: str) -> list[Pair]:
    """Search, and what was found of all that each photo shows of the picked points."""
    folder = project.parent
    with (folder / "picks.csv").open(newline="") as file:
        by_hand = {(row["image"], row["label"]) for row in csv.DictReader(file)}
    match_picks(project)
    with (folder / "picks.csv").open(newline="") as file:
        found = {
            (row["image"], row["label"]): (
                float(row["u_px"]), float(row["v_px"]), float(row["sigma_px"])
            )
            for row in csv.DictReader(file)
            if row["source"] == "match"
        }  # fmt: skip
    labels = {label for _, label in by_hand}
    return [
        pair
        for photo, sights in true_pixels.items()
        for label, true in sights.items()
        if label in labels and (photo, label) not in by_hand
        for pair in [_pair(flight, (photo, label), true, found)]
        if pair.visible or np.isfinite(pair.du)
    ]


def _pair(
    flight: str,
    of: tuple[str, str],
    true: tuple[float, float, bool],
    found: Mapping[tuple[str, str], tuple[float, float, float]],
) -> Pair:
    u, v, sigma = found.get(of, (np.nan, np.nan, np.nan))
    return Pair(flight, *of, bool(true[2]), u - true[0], v - true[1], sigma)


def _shown(told: Mapping[str, Any]) -> dict[str, list[str]]:
    """The photos that show each point, in their order."""
    shows: dict[str, list[str]] = {}
    for photo, sights in sorted(told["pixels"].items()):
        for label, (_, _, visible) in sights.items():
            known = label in told["height_above_ground_m"] and "_" not in label
            if visible and known and label[0] in "PQZDRVW":
                shows.setdefault(label, []).append(photo)
    return shows


def shared_street(
    name: str, draw: int, folder: Path, picked: str | None, given: argparse.Namespace
) -> list[Pair]:
    """Pairs of a street of the data folder."""
    data = Path(os.environ.get("UAVGRAM_DATA", Path(__file__).parents[3] / "shared" / "data"))
    told = json.loads((data / "truth" / f"{name}.json").read_text(encoding="utf-8"))
    rng, above = np.random.default_rng((17, draw)), told["height_above_ground_m"]
    shows = _shown(told)
    rows = [["image", "label", "u_px", "v_px", "sigma_px", "height_m"]]
    flight = sorted(told["pixels"])
    for label in sorted(shows):
        is_raised = label[0] in OFF_GROUND
        if is_raised and above[label] <= FOOT_M:
            continue
        best = told["best_frame"][label]
        if picked is not None:
            asked = PICKED[picked](flight if given.in_photo else shows[label])
        elif draw or best not in shows[label]:
            asked = [shows[label][int(rng.integers(len(shows[label])))]]
        else:
            asked = [best]
        photos = [photo for photo in asked if photo in shows[label]]
        for photo in photos:
            u, v = told["pixels"][photo][label][:2] + given.noise * rng.normal(size=2)
            own = "" if given.blank or not is_raised else "free"
            rows.append([photo, label, f"{u:.3f}", f"{v:.3f}", str(NOISE_PX), own])
    folder.mkdir(parents=True)
    natural = [label for label in dict.fromkeys(row[1] for row in rows[1:]) if label[0] == "P"]
    measures = [["name", "kind", "points"], ["D0", "distance", ";".join(natural[:2])]]
    tables = {"picks": rows, "measure": measures}
    for table, content in tables.items():
        with (folder / f"{table}.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(content)
    files: dict[str, object] = {table: str(folder / f"{table}.csv") for table in tables}
    if given.no_log:
        files |= {"log": None, "time": None}
    project = copy_project(data / name, folder, **files)
    if name == "street_rolling" or given.no_log:
        write_ties(project)
        project = copy_project(data / name, folder, **files, ties=str(folder / "ties.csv"))
    return _found(project, told["pixels"], name)


def _distances(street: Street, folder: Path, flight: str, height: str) -> dict[str, Any]:
    """Errors and sigmas of distances between natural points, all picked with noise, matched."""
    _matched(street, folder, NOISE_PX, flight, height)
    result = compute(read_inputs(folder / "project.yaml"), curved=False).result
    place = dict(zip(street.label, street.point, strict=True))
    measured = result.measurements
    true = [float(np.linalg.norm(place[a] - place[b])) for a, b in measured.points]
    return {
        "error": (np.asarray(measured.value) - true).tolist(),
        "sigma": np.asarray(measured.sigma).tolist(),
        "messages": [f"{m.code}: {m.text[:300]}" for m in result.messages if "match" in m.code],
    }


def row(name: str, pairs: list[Pair]) -> str:
    """The table's line of some pairs."""
    if not pairs:
        return f"{name:26s}      0"
    visible = [p for p in pairs if p.visible]
    error = np.array([[p.du, p.dv] for p in pairs])
    sigma = np.array([p.sigma for p in pairs])
    seen = np.array([p.visible for p in pairs])
    found = np.isfinite(sigma)
    off = np.linalg.norm(error, axis=1) > WRONG_PX
    good = found & seen & ~off
    rms, z = _rms(error[good]), _rms(error[good] / sigma[good, None])
    wrong = found & off
    share = 100 * wrong.sum() / max(found.sum(), 1)
    return (
        f"{name:26s} {len(visible):6d} {100 * (good.sum()) / max(len(visible), 1):6.1f} {rms:6.3f} "
        f"{z:6.2f} {int(wrong.sum()):5d} {share:6.2f} "
        f"{int((found & ~seen).sum()):6d}"
    )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def tell(done: list[dict[str, Any]], worst: int) -> None:
    """Print the tables."""
    heads = ("pairs", "found", "rms", "z", "wrong", "%", "hidden")
    print(" " * 27 + " ".join(f"{head:>6s}" for head in heads))
    pairs = [pair for each in done for pair in each["pairs"]]
    kinds = (
        ("natural", "P"),
        ("weak", "Q"),
        ("zebra and dashes", "ZD"),
        ("discs", "R"),
        ("chequers", "G"),
    )
    for kind, letters in (*kinds, ("cars", "V"), ("walls", "W")):
        mine = [p for p in pairs if p.label[0] in letters]
        print(row(kind, mine))
        for flight in dict.fromkeys(p.flight for p in mine):
            print(row(f"  {flight}", [p for p in mine if p.flight == flight]))
    ranked = sorted((p for p in pairs if np.isfinite(p.du)), key=lambda p: -np.hypot(p.du, p.dv))
    for p in ranked[:worst]:
        print(f"  {p.flight} {p.photo} {p.label}: {p.du:.2f} {p.dv:.2f} +- {p.sigma:.2f}")
    for each in done:
        if each["distances"] is None:
            continue
        error, sigma = (np.array(each["distances"][key]) for key in ("error", "sigma"))
        held = np.isfinite(sigma)
        z = _rms(error[held] / sigma[held])
        print(
            f"{each['flight']:20s} distances {held.sum()}: z {z:.2f}, mean error "
            f"{np.abs(error[held]).mean():.4f} m; cpu {each['seconds']:.0f} s"
        )
        for message in each["distances"]["messages"]:
            print("   ", message)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--flights", type=int, default=6)
    parser.add_argument("--only", type=int, nargs="*", help="flights by their numbers")
    parser.add_argument("--seed", type=int, default=700)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--json", help="where all pairs are written")
    parser.add_argument(
        "--folder", help="where the projects are kept; photos there are not rendered again"
    )
    parser.add_argument("--worst", type=int, default=10, help="so many, by name")
    parser.add_argument("--shared", type=int, metavar="DRAW", help="the data folder's streets")
    parser.add_argument("--streets", nargs="*", choices=SHARED, default=SHARED)
    parser.add_argument("--blank", action="store_true", help="heights of corners, instead of free")
    parser.add_argument("--picked", nargs="*", choices=list(PICKED), default=[None])
    parser.add_argument("--in-photo", action="store_true", help="the flight's photos, not each's")
    parser.add_argument("--noise", type=float, default=0.0, help="of the clicks [px]")
    parser.add_argument("--no-log", action="store_true", help="poses by ties and lengths alone")
    given = parser.parse_args()
    height = "" if given.blank else "free"
    if given.shared is not None:
        cv2.setNumThreads(1)
        for picked in given.picked:
            print(f"picked in: {picked or given.shared}")
            with TemporaryDirectory(prefix="matching") as temporary:
                found = [
                    shared_street(name, given.shared, Path(temporary) / name, picked, given)
                    for name in given.streets
                ]
            tell([{"pairs": pairs, "distances": None} for pairs in found], given.worst)
        return
    which = given.only if given.only is not None else range(given.flights)
    done = []
    with ProcessPoolExecutor(given.workers) as pool:
        for job in [pool.submit(run, k, given.seed, given.folder, height) for k in which]:
            try:
                done.append(job.result())
            except UavgramError as fault:
                print(f"no result: {str(fault)[:300]}")
    tell(done, given.worst)
    if given.json:
        plain = [each | {"pairs": [asdict(p) for p in each["pairs"]]} for each in done]
        Path(given.json).write_text(json.dumps(plain))


if __name__ == "__main__":
    main()
