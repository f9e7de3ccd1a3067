"""One survey adjusted and measured by this program and by GTSAM with its C++ factors.

    python -m venv /tmp/gtsam && /tmp/gtsam/bin/pip install gtsam==4.3.0
    python tests/benchmarks/bench_beside_gtsam.py /tmp/gtsam/bin/python [FRAMES] [MEASUREMENTS]

FRAMES (500) photos of 20 picks, every point in five photos, a log's pose for each, taped lengths on
one point in fifty, a lens with priors, level ground; MEASUREMENTS (1,000) distances between
neighbours. GTSAM has no factor for what a log's poses have in common (clock, biases, boresight),
nor for points of one plane: so in ours these are known, and the ground is level and known to
0.1 mm; its points have a height each, with a prior of that. The minimum and the sigmas are then the
same, and it is said how far they are apart.

Both build, adjust, hand over the covariance of every pose and point, then measure: sigmas of the
distances by joint covariances of their ends (ours: the joint covariance of all of them). Seconds of
processor time, loading of modules left out, by turns in processes of their own with one BLAS
thread; a ratio is the median of PAIRS pairs. Beside the whole stands the way to the minimum alone,
where ours also writes the statistics of each step. No demand: it says where we stand.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import numpy as np
from large_survey import large_survey
from scenes import NO_TIMES
from scipy.spatial import cKDTree

from uavgram.estimation.measuring.propagation import propagate
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine
from uavgram.stages.refine.minima import Participants, find_best_minima

PAIRS = 5
KNOWN = 1e-9
GROUND_SIGMA_M = 1e-4


def survey_of(frames: int) -> Survey:
    """The flight, as far as GTSAM's factors can say it."""
    survey = large_survey(frames)
    assert survey.telemetry is not None
    telemetry = replace(
        survey.telemetry,
        clock_sigma_s=KNOWN,
        clock_drift_sigma=KNOWN,
        boresight_sigma_rad=KNOWN,
        heading_bias_sigma_rad=KNOWN,
        lever_arm_sigma_m=KNOWN,
        position_bias_sigma_m=np.full(3, KNOWN),
    )
    covariance = survey.calibration.covariance.copy()
    covariance[8] = covariance[:, 8] = 0.0  # GTSAM's lens has no third radial term
    ground = replace(survey.grounds[0], height_sigma_m=GROUND_SIGMA_M, slope_sigma_rad=KNOWN)
    return replace(
        survey,
        telemetry=telemetry,
        calibration=replace(survey.calibration, covariance=covariance),
        grounds=(ground,),
    )


def asked_of(survey: Survey, count: int) -> np.ndarray:
    """(count, 2) neighbours, by what the log says of their places."""
    first = first_points(survey)
    rng = np.random.default_rng(1)
    start = rng.choice(len(first), min(count, len(first)), replace=False)
    near = np.asarray(cKDTree(first).query(first[start], k=2)[1])[:, 1]
    return np.column_stack([start, near])


def first_points(survey: Survey) -> np.ndarray:
    """(K, 2) means of where the picks of each point lie on the ground, by the log's poses."""
    assert survey.seeds is not None
    fx, fy, cx, cy = survey.calibration.parameters[:4]
    flat = (survey.pixel_px - [cx, cy]) / [fx, fy]
    ray = np.einsum(
        "nij,nj->ni",
        survey.seeds.world_from_camera[survey.pick_frame],
        np.column_stack([flat, np.ones(len(flat))]),
    )
    center = survey.seeds.center_world_m[survey.pick_frame]
    place = center[:, :2] - ray[:, :2] * (center[:, 2:] / ray[:, 2:])
    total = np.zeros((len(survey.label), 2))
    np.add.at(total, survey.pick_label, place)
    return total / np.bincount(survey.pick_label)[:, None]


def job_of(survey: Survey, asked: np.ndarray) -> dict[str, np.ndarray]:
    """What GTSAM needs."""
    assert survey.seeds is not None
    lens, sigma = survey.calibration.parameters, np.sqrt(np.diag(survey.calibration.covariance))
    own = survey.seeds.covariance[0]  # of the centre, then of the turn in camera axes
    first = first_points(survey)
    return {
        "lens": lens[:8],
        "lens_sigma": sigma[:8],
        "center": survey.seeds.center_world_m,
        "rotation": survey.seeds.world_from_camera,
        # GTSAM's: of the turn, then of the centre in the camera's axes (alike in all directions)
        "pose_covariance": np.roll(own, (3, 3), (0, 1)),
        "point": np.column_stack([first, np.zeros(len(first))]),
        "ground_sigma": np.array([1e3, 1e3, GROUND_SIGMA_M]),
        "frame": survey.pick_frame,
        "label": survey.pick_label,
        "pixel": survey.pixel_px,
        "pick_sigma": survey.pick_sigma_px[0],
        "line": np.column_stack([survey.line_start, survey.line_end]),
        "length": survey.length_m,
        "length_sigma": survey.length_sigma_m[0],
        "asked": asked,
    }


def ours(frames: int, asked: np.ndarray, found_path: Path) -> None:
    """Adjust and measure; seconds as the peer gives them."""
    survey = survey_of(frames)
    picks, lines = np.ones(len(survey.pick_frame), bool), np.zeros(len(survey.line_start), bool)
    started = time.process_time()
    minimum = find_best_minima(Participants(survey, picks, lines, {}))
    bare = time.process_time() - started
    clock = [time.process_time()]
    adjustment = refine(survey, SolveOptions())[0].adjustment
    pose = adjustment.frame_covariance()
    _, point = adjustment.points()
    clock.append(time.process_time())
    requests = tuple(
        MeasurementRequest(name=f"d{k}", kind="distance", points=(survey.label[a], survey.label[b]))
        for k, (a, b) in enumerate(asked.tolist())
    )
    sigma = propagate(adjustment, requests, NO_TIMES).sigma
    clock.append(time.process_time())
    np.savez(
        found_path,
        point=minimum.adjustment.state.point[:, :2],
        pose_covariance=pose,
        point_covariance=point,
        distance_sigma=sigma,
    )
    seconds = [0.0, bare, float(clock[1] - clock[0]) - bare, float(clock[2] - clock[1])]
    print(json.dumps({"seconds": seconds, "steps": adjustment.minimum.iterations}))


def apart(own: Path, other: Path) -> str:
    """How far results are apart, in the middle: places in sigmas, sigmas relative.

    Places are those of the minimum; in what ours hands over, its tests have weighed down what they
    doubt, here and there a pick of thousands.
    """
    with np.load(own) as one, np.load(other) as two:
        sigma = [
            np.sqrt(np.einsum("nii->ni", found["point_covariance"])[:, :2]) for found in (one, two)
        ]
        moved = np.abs(one["point"] - two["point"][:, :2]) / sigma[0]
        pose = [np.sqrt(np.einsum("nii->ni", found["pose_covariance"])) for found in (one, two)]
        turn = pose[0][:, 3:] / pose[1][:, :3] - 1
        far = one["distance_sigma"] / two["distance_sigma"] - 1
    told = {
        "points": moved,
        "their sigmas": sigma[0] / sigma[1] - 1,
        "those of turns": turn,
        "of distances": far,
    }
    return ", ".join(
        f"{name} {np.median(np.abs(one)):.0e} ({np.abs(one).max():.0e} at most)"
        for name, one in told.items()
    )


def main(python: str, frames: int, measurements: int) -> int:
    """Print seconds of both, and ratios."""
    survey = survey_of(frames)
    asked = asked_of(survey, measurements)
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as scratch:
        job, own, other = (Path(scratch) / f"{name}.npz" for name in ("job", "own", "other"))
        np.savez(job, **job_of(survey, asked))  # type: ignore[arg-type]
        commands = (
            [sys.executable, __file__, "--ours", str(frames), str(job), str(own)],
            [python, str(Path(__file__).with_name("gtsam_survey.py")), str(job), str(other)],
        )
        took = []
        for _ in range(PAIRS):
            pair = []
            for command in commands:
                done = subprocess.run(
                    command, check=True, stdout=subprocess.PIPE, text=True, env=environment
                )
                pair.append(json.loads(done.stdout.splitlines()[-1]))
            took.append([one["seconds"] for one in pair])
            print(f"  steps {[one['steps'] for one in pair]}: {np.round(took[-1], 3).tolist()}")
        distance = apart(own, other)
    seconds = np.array(took)  # pairs, ours and theirs, stages
    stages = {
        "to the minimum": seconds[..., :2].sum(-1),
        "with all covariances": seconds[..., :3].sum(-1),
        f"{len(asked)} distances": seconds[..., 3],
        "the whole": seconds.sum(-1),
    }
    print(
        f"{frames} frames, {len(survey.label)} points, {len(survey.pick_frame)} picks: {distance}"
    )
    for name, (mine, theirs) in ((name, each.T) for name, each in stages.items()):
        print(
            f"{name}: GTSAM {np.median(theirs):.3f} s, ours {np.median(mine):.3f} s of processor: "
            f"{np.median(theirs / mine):.2f} times ours"
        )
    return 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["--ours"]:
        with np.load(sys.argv[3]) as file:
            ours(int(sys.argv[2]), file["asked"], Path(sys.argv[4]))
    else:
        numbers = [int(text) for text in sys.argv[2:]]
        sys.exit(main(sys.argv[1], *(numbers + [500, 1000][len(numbers) :])))
