"""Our tie points and adjustment beside pycolmap's incremental mapping, on the same photos.

    python -m venv /tmp/colmap && /tmp/colmap/bin/pip install pycolmap==4.2.1
    python tests/benchmarks/bench_beside_pycolmap.py --pycolmap /tmp/colmap/bin/python

Flights over rendered streets (even numbers look down, odd ones 45 degrees ahead), each of its own
seed, with a shutter of 0 and of 30 ms. Both have the calibrated camera, which is not quite the true
one: pycolmap holds it, ours knows its sigmas (and of the shutter 30 +- 3 ms). Ours runs with the
log, without any pose but with the times of the photos, as every camera writes them, and with
nothing: no log and no EXIF, as pycolmap. For each:

    photos   in the adjustment, of all
    centres  root mean square error of the camera centres (middle row) after the best similarity [m]
    distance between points withheld: how many have a value, mean and root mean square error [m];
             each picked in one photo with 0.8 px, several draws. The scale is that of the same two
             lengths, between labels picked in two photos; how wrong it is (root mean square of
             the draws), and what errors remain with each draw's best scale
    wall, CPU, memory of ties (features, pairs, mapping) and of the adjustment of one draw; each in
             a process of its own, loading of packages included in CPU only

First stands what the noise of picks and lengths alone leaves: rays of the true poses, by the row,
at the true heights. Of what a way of finding poses is off, only the rest is its own.

pycolmap knows no picks. Their rays are intersected with a ground of its points, in two ways: with
the plane that most of them lie on (as ours is a plane), and with that plane lifted to the median
height of the 30 points that are nearest. Places of labels picked twice are the mean of two; its
scale is the least-squares one of the two lengths.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import numpy as np
from pycolmap_ground import NEAREST, Ground, ground_of
from streets.street import Street
from streets.writing import Seeds, Tables, photo_names, write_street
from study_ties import study_street, tables, true_rays

from uavgram.errors import UavgramError
from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Floats
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.picks_table import write_ties

HERE = Path(__file__).parent
OURS: dict[Seeds, str] = {
    "log": "ours, with the log",
    "times": "ours, photo times alone",
    "none": "ours, not even times",
}
Ways = Literal["plane", "near points"]


def ours(folder: Path) -> None:
    """In a process of its own: the ties of FOLDER/ties, then every draw's adjustment with them."""
    start, before = time.perf_counter(), _cpu_s()
    done: dict[str, Any] = {"poses": {}, "draws": [], "said": []}
    try:
        write_ties(folder / "ties" / "project.yaml")
    except UavgramError as fault:
        done["said"].append(str(fault)[:300])
    done["ties"] = [time.perf_counter() - start, _cpu_s()]
    for draw in sorted(folder.glob("draw*")):
        start, before = time.perf_counter(), _cpu_s()
        try:
            shutil.copy(folder / "ties" / "ties.csv", draw / "ties.csv")
            result = compute(read_inputs(draw / "project.yaml"), curved=False).result
        except (UavgramError, FileNotFoundError) as fault:
            done["said"].append(str(fault)[:300])
            continue
        done["adjusted"] = [time.perf_counter() - start, _cpu_s() - before]
        frames, measured = result.frames, result.measurements
        done["draws"].append([measured.value.tolist(), measured.sigma.tolist()])
        done["said"] += [f"{m.code}: {m.text[:160]}" for m in result.messages if m.level != "info"]
        if not done["poses"]:
            places = zip(frames.frame_id, frames.status, frames.refined.center_world_m, strict=True)
            done["poses"] = {name: c.tolist() for name, how, c in places if how == "refined"}
    status = Path("/proc/self/status").read_text()
    done["memory_mb"] = int(status.split("VmHWM:")[1].split()[0]) / 1024
    (folder / "done.json").write_text(json.dumps(done))


def _cpu_s() -> float:
    return sum(os.times()[:4])


def run_ours(street: Street, folder: Path, seeds: Seeds, drawn: list[Tables]) -> None:
    """Write the projects of one way to begin, run them, tell."""
    write_street(street, _with_photos(folder / seeds / "ties"), drawn[0], seeds)
    for k, each in enumerate(drawn):
        into = _with_photos(folder / seeds / f"draw{k}")
        write_street(street, into, each, seeds, {"ties": "ties.csv"})
    subprocess.run([sys.executable, __file__, "--ours", folder / seeds], check=True)
    done = json.loads((folder / seeds / "done.json").read_text())
    pairs = zip(drawn, done["draws"], strict=False)
    errors = [np.array(value) - _true(street, each) for each, (value, _) in pairs]
    sigmas = [np.array(sigma) for _, sigma in done["draws"]]
    if errors:
        z = np.concatenate([error / sigma for error, sigma in zip(errors, sigmas, strict=True)])
        stated = f"z {np.sqrt(np.nanmean(z**2)):.2f}"
    else:
        stated = "no result"
    poses = {name: np.array(c) for name, c in done["poses"].items()}
    tell(street, OURS[seeds], poses, (errors, drawn))
    wall, cpu = np.add(done["ties"], done.get("adjusted", [0.0, 0.0]))
    print(
        f"{'':26s}{stated}; wall {wall:.1f} s, CPU {cpu:.1f} s (ties {done['ties'][1]:.1f}, "
        f"adjustment {done.get('adjusted', [0, 0])[1]:.1f}), {done['memory_mb']:.0f} MB",
        flush=True,
    )
    for text in dict.fromkeys(done["said"]):
        print(f"{'':28s}{text[:120]}")


def _with_photos(folder: Path) -> Path:
    """The folder, in which the photos are those two folders further up."""
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "photos").exists():
        (folder / "photos").symlink_to(folder.parents[1] / "photos")
    return folder


def run_pycolmap(street: Street, folder: Path, python: str, drawn: list[Tables]) -> None:
    """Map the photos, intersect the picks with its ground, tell."""
    camera, out = folder / "camera.yaml", folder / "mapped.json"
    command: list[str | Path] = [
        python,
        HERE / "pycolmap_mapping.py",
        folder / "photos",
        camera,
        out,
    ]
    ran = subprocess.run(command, check=False, capture_output=True, text=True)
    if ran.returncode:
        sys.exit(f"pycolmap: {ran.stderr[-500:]}\nMake a Python that has it: see --help")
    done = json.loads(out.read_text())
    poses = {n: (np.array(c), np.array(r)) for n, (c, r) in done["poses"].items()}
    ground = ground_of(np.array(done["points"]), [c for c, _ in poses.values()]) if poses else None
    lens = np.array(json.loads(camera.read_text())["parameters"])
    ways: tuple[Ways, ...] = ("plane", "near points")
    for way in ways:
        errors = [] if ground is None else [
            _intersected(each, poses, (ground, lens, way)) - _true(street, each) for each in drawn
        ]  # fmt: skip
        places = {name: c for name, (c, _) in poses.items()}
        tell(street, f"pycolmap, {way}", places, (errors, drawn))
    print(
        f"{'':26s}{done['models']} model(s); wall {done['wall_s']:.1f} s, "
        f"CPU {done['cpu_s']:.1f} s, {done['memory_mb']:.0f} MB",
        flush=True,
    )


def _intersected(
    drawn: Tables, poses: dict[str, tuple[Floats, Floats]], by: tuple[Ground, Floats, Ways]
) -> Floats:
    """(m,) distances in metres, NaN where a photo of theirs is not in the model."""
    ground, lens, way = by
    found: dict[str, list[Floats]] = defaultdict(list)
    for pick in drawn.picks:
        if pick.photo in poses:
            center, turn = poses[pick.photo]
            ray = turn @ back_project("brown", lens, np.array([[pick.u_px, pick.v_px]]))[0]
            near = NEAREST if way == "near points" else 0
            found[pick.label].append(ground.met(center, ray, near))
    return _distances(drawn, found)


def _distances(drawn: Tables, found: dict[str, list[Floats]]) -> Floats:
    """(m,) in the scale of the known lengths, by where rays met the ground; NaN without."""
    place: dict[str, Floats] = defaultdict(lambda: np.full(3, np.nan))
    place.update({label: np.mean(each, axis=0) for label, each in found.items()})

    def lengths(pairs: list[tuple[str, str]]) -> Floats:
        return np.array([np.linalg.norm(place[a] - place[b]) for a, b in pairs])

    here = lengths([(a, b) for a, b, _, _ in drawn.lengths])
    known = np.array([length for _, _, length, _ in drawn.lengths])
    held = np.isfinite(here)
    scale = here[held] @ known[held] / (here[held] @ here[held]) if held.any() else np.nan
    return np.asarray(scale * lengths(list(drawn.distances)))


def picks_alone(street: Street, drawn: Tables) -> Floats:
    """(m,) distances by the picks and lengths, where poses and heights are the true ones."""
    frame = {name: k for k, name in enumerate(photo_names(street))}
    height = {label: point[2] for label, point in zip(street.label, street.point, strict=True)}
    photo = np.array([frame[pick.photo] for pick in drawn.picks])
    pixel = np.array([[pick.u_px, pick.v_px] for pick in drawn.picks])
    center, ray = true_rays(street, photo, pixel)
    found: dict[str, list[Floats]] = defaultdict(list)
    for pick, place, along in zip(drawn.picks, center, ray[:, 1], strict=True):
        found[pick.label].append(place + along * (height[pick.label] - place[2]) / along[2])
    return _distances(drawn, found)


def _true(street: Street, drawn: Tables) -> Floats:
    place = dict(zip(street.label, street.point, strict=True))
    return np.array([np.linalg.norm(place[a] - place[b]) for a, b in drawn.distances])


def tell(
    street: Street, name: str, poses: dict[str, Floats], made: tuple[list[Floats], list[Tables]]
) -> None:
    """Print the accuracy of one way.

    Parameters
    ----------
    street
        The truth.
    name
        Of the way.
    poses
        Camera centres by photo.
    made
        Errors of the distances [m] of each draw, and the draws.
    """
    errors, drawn = made
    frame = {name: k for k, name in enumerate(photo_names(street))}
    line = f"{name:26s}{len(poses):3d} of {len(frame)} photos"
    if len(poses) > 2:
        here = np.array(list(poses.values()))
        there = np.array([street.view[frame[photo]].center for photo in poses])
        line += f"; centres {_after_similarity(here, there):.3f} m"
    if errors:
        error = np.concatenate(errors)
        held = error[np.isfinite(error)]
        line += f"; distances {len(held)} of {len(error)}"
        if len(held):
            root = np.sqrt(np.mean(held**2))
            line += f": mean {np.abs(held).mean():.4f} m, rms {root:.4f} m"
            both = [_scaled(e, _true(street, d)) for e, d in zip(errors, drawn, strict=False)]
            wrong, rest = np.sqrt(np.nanmean(np.square(both), axis=0))
            line += f"; scale {100 * wrong:.2f} %, rest {rest:.4f} m"
    print(line, flush=True)


def _scaled(error: Floats, true: Floats) -> tuple[float, float]:
    """By how much the best scale of distances differs from 1, and the rms of what it leaves."""
    held = np.isfinite(error)
    value, length = (error + true)[held], true[held]
    scale = value @ length / (length @ length)
    return float(scale - 1.0), float(np.sqrt(np.mean((value / scale - length) ** 2)))


def _after_similarity(here: Floats, there: Floats) -> float:
    """Root mean square distance (Umeyama 1991)."""
    a, b = here - here.mean(axis=0), there - there.mean(axis=0)
    left, size, right = np.linalg.svd(b.T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    moved = (size @ sign / np.sum(a**2)) * a @ (left @ np.diag(sign) @ right).T
    return float(np.sqrt(np.mean(np.sum((moved - b) ** 2, axis=1))))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pycolmap", metavar="PYTHON", help="a Python that has pycolmap")
    parser.add_argument("--flights", type=int, default=2)
    parser.add_argument("--photos", type=int, default=8)
    parser.add_argument("--seed", type=int, default=9500)
    parser.add_argument("--draws", type=int, default=6, help="picks and lengths so many times")
    parser.add_argument("--readout-ms", type=float, nargs="*", default=[0.0, 30.0])
    parser.add_argument("--ours-with", nargs="*", choices=list(OURS), default=list(OURS))
    parser.add_argument("--folder", help="where the projects are kept")
    parser.add_argument("--ours", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.ours:
        ours(given.ours)
        return
    with TemporaryDirectory(prefix="beside") as temporary:
        for index in range(given.flights):
            for readout in given.readout_ms:
                street = study_street(index, given.seed, given.photos, readout / 1e3)
                folder = Path(given.folder or temporary).absolute() / f"b{index}_{readout:g}"
                drawn = [tables(street, draw) for draw in range(given.draws)]
                write_street(street, folder, drawn[0], "none")
                print(f"{street.wish.kind} {street.seed}, {readout:g} ms", flush=True)
                alone = [picks_alone(street, each) - _true(street, each) for each in drawn]
                tell(street, "picks and lengths alone", {}, (alone, drawn))
                if given.pycolmap:
                    run_pycolmap(street, folder, given.pycolmap, drawn)
                for seeds in given.ours_with:
                    run_ours(street, folder, seeds, drawn)


if __name__ == "__main__":
    main()
