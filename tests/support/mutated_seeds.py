"""Seeds of a survey from damaged logs: what moves them by more than three sigma without a word.

python tests/support/mutated_seeds.py LOGS_FOLDER [--count 24000] [--first 0] [--seconds 1e9]
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import traceback
import warnings
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TypedDict

import cv2
import numpy as np
from log_mutants import mutant, short_logs

from uavgram.errors import UavgramError
from uavgram.estimation.clocks.clock_line import convert_boot_to_utc, fit_boot_clock
from uavgram.geometry.geodesy import Origin, enu_from_geodetic, geodetic_from_enu
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.model.arrays import Floats
from uavgram.pipeline.measure.inputs import Inputs, log_messages, read_inputs
from uavgram.pipeline.measure.pose import pose_frames

LIMIT_SIGMAS = 3.0
PROGRESS = 500  # mutants, after which it says how far it is
PHOTOS, BETWEEN_BOOT_S = 30, (150.8, 159.2)
SUFFIXES = (".BIN", ".log", ".tlog")
PROJECT = """images: photos/*.jpg
log: flight{suffix}
camera: camera.yaml
picks: picks.csv
mount: {{gimbal: {gimbal}}}
time: {{source: filename, filename_format: "%Y%m%d_%H%M%S_%f", offset_s: 0.0, offset_sigma_s: 0.05}}
"""
CAMERA = """name: stand-in
model: brown
width_px: 16
height_px: 16
parameters: [12.0, 12.0, 7.5, 7.5, 0.0, 0.0, 0.0, 0.0, 0.0]
sigma: [0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0]
"""


class Tally(TypedDict):
    """How many mutants came to what; those that crashed, or moved a seed without a word."""

    tried: int
    read: int
    refused: int
    warned: int
    moved: int
    crashed: list[str]
    silent: list[str]


@dataclass(frozen=True)
class Seen:
    """Seeds of one log under both mounts, and the texts of their messages."""

    frames: tuple[tuple[str, ...], ...]
    place: tuple[Floats, ...]
    center_m: tuple[Floats, ...]
    rotation: tuple[Floats, ...]
    sigma: tuple[Floats, ...]
    texts: frozenset[str]


def survey(folder: Path, suffix: str, data: bytes, times_utc_s: Floats) -> list[Inputs]:
    """The same photos with the log's gimbal, and with a camera fixed to the body."""
    photos = folder / "photos"
    photos.mkdir(parents=True, exist_ok=True)
    picture = cv2.imencode(".jpg", np.zeros((16, 16, 3), dtype=np.uint8))[1].tobytes()
    for moment in times_utc_s:
        name = datetime.fromtimestamp(float(moment), tz=UTC).strftime("%Y%m%d_%H%M%S_%f")
        (photos / f"{name}.jpg").write_bytes(picture)
    (folder / "camera.yaml").write_text(CAMERA)
    (folder / "picks.csv").write_text("image,label,u_px,v_px\n")
    (folder / f"flight{suffix}").write_bytes(data)
    found = []
    for gimbal in ("auto", "none"):
        project = folder / f"{gimbal}.yaml"
        project.write_text(PROJECT.format(suffix=suffix, gimbal=gimbal))
        found.append(read_inputs(project, unfinished=True))
    return found


def seen(surveys: list[Inputs], path: Path) -> Seen:
    """Read a log and seed the photos from it, as the program does."""
    log = read_flight_log(path)
    texts = [m.text for m in log_messages(log)]
    posed = [pose_frames(replace(inputs, log=log)) for inputs in surveys]
    poses = [p.telemetry.poses for p in posed if p.telemetry is not None]
    for p in posed:
        texts += [f"{m.code}: {m.text}" for m in p.messages if m.level != "info"]
    place = []
    for p, found in zip(posed, poses, strict=True):
        assert p.world.origin is not None
        place.append(np.stack(geodetic_from_enu(found.center_world_m, p.world.origin), axis=1))
    return Seen(
        frames=tuple(p.frame_id for p in poses),
        place=tuple(place),
        center_m=tuple(p.center_world_m for p in poses),
        rotation=tuple(p.world_from_camera for p in poses),
        sigma=tuple(np.sqrt(np.diagonal(p.covariance, axis1=1, axis2=2)) for p in poses),
        texts=frozenset(texts),
    )


def moved(base: Seen, other: Seen) -> tuple[float, str]:
    """The largest departure in sigmas of the base, and of what; frames of both only."""
    worst, what = 0.0, ""
    for m, mount in enumerate(("gimbal", "body")):
        row = {name: k for k, name in enumerate(base.frames[m])}
        here = [k for k, name in enumerate(other.frames[m]) if name in row]
        mine = [row[other.frames[m][k]] for k in here]
        if not here:
            continue
        latitude, longitude, height = base.place[m][0]
        origin = (latitude, longitude, height)
        change = _from_origin(other.place[m][here], origin)
        change -= _from_origin(base.place[m][mine], origin)
        home = other.center_m[m][here] - base.center_m[m][mine]
        turned = np.swapaxes(base.rotation[m][mine], 1, 2) @ other.rotation[m][here]
        angle = np.stack([cv2.Rodrigues(r)[0][:, 0] for r in turned])
        sigma = base.sigma[m][mine]
        for name, values, s in (
            ("place [m]", change, sigma[:, :3]),
            ("place from home [m]", home, sigma[:, :3]),
            ("direction [rad]", angle, sigma[:, 3:]),
        ):
            ratio = np.abs(values) / s
            at = np.unravel_index(ratio.argmax(), ratio.shape)
            if ratio[at] > worst:
                frame = other.frames[m][here[at[0]]]
                worst = float(ratio[at])
                what = f"{mount}: {name} by {values[at]:.3f} ({worst:.1f} sigma) of {frame}"
    return worst, what


def _from_origin(place: Floats, origin: Origin) -> Floats:
    return enu_from_geodetic(place[:, 0], place[:, 1], place[:, 2], origin)


def examine(logs: Path, suffix: str, seeds: range, seconds: float = 1e9) -> Tally:
    """Read mutants of one form; what crashed, and what moved a seed without a word."""
    data = short_logs(logs)[suffix]
    tally: Tally = {
        "tried": 0,
        "read": 0,
        "refused": 0,
        "warned": 0,
        "moved": 0,
        "crashed": [],
        "silent": [],
    }
    started = time.process_time()
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("error")  # a library's warning on the screen is a fault as well
        folder = Path(name)
        times = exposures(logs)
        surveys = survey(folder, suffix, data, times)
        path = folder / f"flight{suffix}"
        base = seen(surveys, path)
        for seed in seeds:
            if time.process_time() - started > seconds:
                break
            tally["tried"] += 1
            if tally["tried"] % PROGRESS == 0:
                sys.stderr.write(f"{suffix} {json.dumps(tally)}\n")
            kind, damaged = mutant(suffix, data, seed)
            path.write_bytes(damaged)
            _judge(tally, f"{suffix} {seed} {kind}", base, surveys, path)
    return tally


def _judge(tally: Tally, name: str, base: Seen, surveys: list[Inputs], path: Path) -> None:
    try:
        found = seen(surveys, path)
    except UavgramError:
        tally["refused"] += 1
        return
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
        at = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(at.filename).name}:{at.lineno}"
        tally["crashed"].append(f"{name}: {type(error).__name__} in {place}: {error}"[:300])
        return
    tally["read"] += 1
    new = found.texts - base.texts
    tally["warned"] += bool(new)
    worst, what = moved(base, found)
    if worst > LIMIT_SIGMAS:
        tally["moved"] += 1
        if not new:
            tally["silent"].append(f"{name}: {what}")
            sys.stderr.write(f"{name}: {what}\n")


def exposures(logs: Path) -> Floats:
    """Instants over the ten seconds, less their ends, where any loss leaves photos out."""
    boot = read_flight_log(logs / "twin_short.BIN").boots[0]
    return convert_boot_to_utc(fit_boot_clock(boot)[0], np.linspace(*BETWEEN_BOOT_S, PHOTOS))


def main() -> None:
    """Share the count among the three forms and print what was found."""
    parser = argparse.ArgumentParser()
    parser.add_argument("logs", type=Path)
    parser.add_argument("--count", type=int, default=24000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=1e9, help="CPU seconds for each form")
    parser.add_argument("--only", choices=SUFFIXES)
    given = parser.parse_args()
    for suffix in (given.only,) if given.only else SUFFIXES:
        count = given.count if given.only else given.count // len(SUFFIXES)
        seeds = range(given.first, given.first + count)
        tally = examine(given.logs, suffix, seeds, given.seconds)
        sys.stdout.write(json.dumps({suffix: tally}, indent=1) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
