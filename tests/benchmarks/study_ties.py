"""Tie points in rendered streets against their truth: `uavgram picks ties`, whole.

Streets of tests/support/streets, each of its own seed: nothing was tuned on them. For each flight:

    ties     sightings, tie points; time [CPU s a photo]
    epipolar median distance of one sighting to the line of another, by the true poses [px];
             share beyond 3 px, per cent
    withheld with two lengths and six labels each picked in two photos: mean error of distances
             between points that are picked once [m], and z, without ties and with them; picks
             and lengths are drawn several times

    python tests/benchmarks/study_ties.py --flights 2 --photos 40 --seed 9000 --json ties.json
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import cv2
import numpy as np
from streets.flight import Kind
from streets.street import Street, Wish, draw_street
from streets.writing import Pick, Tables, photo_names, picked, write_street

from uavgram.errors import UavgramError
from uavgram.model.arrays import Floats
from uavgram.model.options import TapeOptions
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.picks_table import write_ties

KINDS: tuple[Kind, ...] = ("nadir", "oblique")
NOISE_PX, LENGTH_SIGMA_M = 0.8, 0.01
TAPE_SCALE = TapeOptions().scale_sigma
"""Of the tape that both lengths are read from: stated where the project says nothing, and a fifth
of the variance of distances over a flight of 40. So it is drawn too."""
FAR_PX = 3.0


def study_street(index: int, seed: int, photos: int, readout_s: float) -> Street:
    """The street of a flight."""
    wish = Wish(
        kind=KINDS[index % 2],
        photos=photos,
        height_m=40.0,
        readout_s=readout_s,
        natural=60,
        width_px=1600,
        height_px=1200,
    )
    return draw_street(seed + index, wish)


def tables(street: Street, draw: int) -> Tables:
    """Six labels in two photos, two lengths between them; the rest picked once, and measured."""
    rng = np.random.default_rng((8, street.seed, draw))
    twice = picked(street, "P", 2, NOISE_PX, rng)
    photos: dict[str, list[Pick]] = defaultdict(list)
    for pick in twice:
        photos[pick.label].append(pick)
    chosen = _neighbours(street, [label for label, picks in photos.items() if len(picks) == 2])
    place = dict(zip(street.label, street.point, strict=True))
    tape = 1.0 + TAPE_SCALE * np.random.default_rng((9, street.seed, draw)).normal()
    lengths = [
        (a, b, float(tape * np.linalg.norm(place[a] - place[b]) + LENGTH_SIGMA_M * rng.normal()),
         LENGTH_SIGMA_M)
        for a, b in (chosen[:2], chosen[2:4])
    ]  # fmt: skip
    picks = [pick for label in chosen for pick in photos[label]]
    once = [each[0] for label, each in photos.items() if label not in chosen]
    order = rng.permutation(len(once))
    pairs = [(once[a].label, once[b].label) for a, b in pairwise(order)]
    return Tables(picks=[*picks, *once], lengths=lengths, distances=pairs)


def _neighbours(street: Street, labels: list[str]) -> list[str]:
    """Six labels: two pairs some metres apart, as a tape reaches, and two more."""
    place = dict(zip(street.label, street.point, strict=True))
    left, chosen = list(labels), list[str]()
    for _ in range(2):
        first = left.pop(0)
        away = [abs(np.linalg.norm(place[first] - place[label]) - 12.0) for label in left]
        chosen += [first, left.pop(int(np.argmin(away)))]
    return [*chosen, *left[:2]]


def run(index: int, given: argparse.Namespace) -> dict[str, Any]:
    """One flight."""
    cv2.setNumThreads(1)
    street = study_street(index, given.seed, given.photos, given.readout_ms / 1e3)
    done: dict[str, Any] = {"flight": f"{street.wish.kind} {given.seeds} {street.seed}"}
    with TemporaryDirectory(prefix="ties") as temporary:
        folder = Path(given.folder or temporary) / f"t{index}"
        ties = folder / "ties.csv"
        project = write_street(street, folder, tables(street, 0), given.seeds)
        start = time.process_time()
        if not (given.keep_ties and ties.exists()):
            ties.unlink(missing_ok=True)
            done["said"] = [str(m.text)[:300] for m in write_ties(project).messages]
        done["seconds"] = (time.process_time() - start) / given.photos
        done |= _epipolar(street, ties)
        for key, options in (("without", {}), ("with", {"ties": "ties.csv"})):
            draws = []
            for draw in range(given.redraw):
                write_street(street, folder, tables(street, draw), given.seeds, options)
                draws.append(_errors(street, project))
            done[key] = draws
    return done


def _errors(street: Street, project: Path) -> dict[str, Any]:
    """Errors and sigmas of the measured distances."""
    try:
        result = compute(read_inputs(project), curved=False).result
    except UavgramError as fault:
        return {"error": [], "sigma": [], "messages": [str(fault)[:300]], "factor": np.nan}
    place = dict(zip(street.label, street.point, strict=True))
    measured = result.measurements
    true = [float(np.linalg.norm(place[a] - place[b])) for a, b in measured.points]
    return {
        "error": (np.asarray(measured.value) - true).tolist(),
        "sigma": np.asarray(measured.sigma).tolist(),
        "messages": [f"{m.code}: {m.text[:200]}" for m in result.messages if m.level != "info"],
        "factor": float(result.solution.variance_factor),
    }


def _epipolar(street: Street, table: Path) -> dict[str, Any]:
    """Distances of the sightings of each tie from the epipolar lines of its first."""
    frame = {name: k for k, name in enumerate(photo_names(street))}
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    pixel = np.array([[float(row["u_px"]), float(row["v_px"])] for row in rows])
    center, ray = true_rays(street, np.array([frame[row["image"]] for row in rows]), pixel)
    sights: dict[str, list[int]] = defaultdict(list)
    for k, row in enumerate(rows):
        sights[row["tie"]].append(k)
    pairs = np.array([(k[0], other) for k in sights.values() for other in k[1:]])
    one, other = pairs.T
    normal = np.cross(center[other] - center[one], ray[one][:, 1])
    # The line in the other photo, in its own normalised plane.
    axes = ray[other][:, 2:]
    line = np.einsum("nij,nj->ni", axes, normal)
    away = np.abs((ray[other][:, 1] * normal).sum(axis=1)) / np.hypot(line[:, 0], line[:, 1])
    distance = away * street.camera.lens[0]
    sigma = np.array([float(row["sigma_px"]) for row in rows])
    expected = np.hypot(sigma[one], sigma[other])
    good = distance < FAR_PX
    return {
        "sightings": len(rows),
        "ties": len(sights),
        "median": float(np.median(distance)),
        "beyond": float(100 * np.mean(~good)),
        "z": float(np.sqrt(np.mean((distance / expected)[good] ** 2))),
        "worst": [rows[k]["tie"] for k in other[np.argsort(-distance)[:8]]],
    }


def true_rays(street: Street, frame: Floats, pixel: Floats) -> tuple[Floats, Floats]:
    """Centres (n, 3); (n, 5, 3): the ray in the camera, in the street, the camera's axes."""
    lens = street.camera.lens
    matrix = np.array([[lens[0], 0, lens[2]], [0, lens[1], lens[3]], [0, 0, 1]])
    rule = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-12)
    plain = cv2.undistortPoints(pixel[:, None].copy(), matrix, lens[4:], criteria=rule)[:, 0]
    inside = np.column_stack([plain, np.ones(len(plain))])
    center, result = np.zeros((len(pixel), 3)), np.zeros((len(pixel), 5, 3))
    for k in np.unique(frame):
        mine = frame == k
        place, turn = street.view[int(k)].poses(pixel[mine, 1])
        center[mine] = place
        result[mine, 0] = inside[mine]
        result[mine, 1] = np.einsum("nij,nj->ni", turn, inside[mine])
        result[mine, 2:] = np.swapaxes(turn, 1, 2)
    return center, result


def tell(done: dict[str, Any]) -> None:
    """Print one flight."""
    print(
        f"{done['flight']}: {done['ties']} ties, {done['sightings']} sightings, "
        f"{done['seconds']:.2f} s a photo; epipolar median {done['median']:.3f} px, beyond 3 px "
        f"{done['beyond']:.2f} %, over stated {done['z']:.2f}"
    )
    for key in ("without", "with"):
        draws = [each for each in done[key] if np.isfinite(each["sigma"]).any()]
        if not draws:
            print(f"  {key:8s} no distance: {done[key][0]['messages'][:2]}")
            continue
        error, sigma = (np.concatenate([each[k] for each in draws]) for k in ("error", "sigma"))
        held = np.isfinite(sigma)
        # Distances of one draw share the error of its lengths: their mean z is one number.
        means = [np.nanmean(np.divide(each["error"], each["sigma"])) for each in draws]
        z = np.sqrt(np.mean((error[held] / sigma[held]) ** 2))
        print(
            f"  {key:8s} {held.sum()} of {len(held)} distances of {len(draws)} draws: mean error "
            f"{np.abs(error[held]).mean():.4f} m, z {z:.2f}, of each draw "
            f"{' '.join(f'{mean:.1f}' for mean in means)}; factor {draws[0]['factor']:.2f}"
        )
        for message in dict.fromkeys(m for each in draws for m in each["messages"]):
            print("     ", message[:120])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--flights", type=int, default=2)
    parser.add_argument("--only", type=int, nargs="*", help="flights by their numbers")
    parser.add_argument("--photos", type=int, default=40)
    parser.add_argument("--readout-ms", type=float, default=0.0)
    parser.add_argument("--seeds", default="log", choices=["log", "csv", "places", "none"])
    parser.add_argument("--seed", type=int, default=9000)
    parser.add_argument("--redraw", type=int, default=6, help="picks and lengths so many times")
    parser.add_argument("--keep-ties", action="store_true", help="those in the folder, if any")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--json", help="where all figures are written")
    parser.add_argument("--folder", help="where the projects are kept")
    given = parser.parse_args()
    which = given.only if given.only is not None else range(given.flights)
    done = []
    with ProcessPoolExecutor(given.workers) as pool:
        for job in [pool.submit(run, k, given) for k in which]:
            try:
                done.append(job.result())
                tell(done[-1])
            except UavgramError as fault:
                print(f"no result: {str(fault)[:300]}")
    if given.json:
        Path(given.json).write_text(json.dumps(done))


if __name__ == "__main__":
    main()
