"""Single frames side by side with peers in one run: pose from six lengths, and ground points.

    python tests/benchmarks/bench_single_frame.py

Pose: Ceres (pyceres) on the same likelihood with its covariance, one cost function per frame that
numpy evaluates; CameraTransform's Nelder-Mead on its own. All start 3 % off. Ground points: OpenCV
without any covariance, CameraTransform by resampling its pose, and mrcal's unproject with gradients
(Debian's python3-mrcal, in the system's Python; left out where that is absent).

Rounds go in turn, so that what else the machine does falls on all alike; ratios are medians over
rounds of neighbouring runs.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cameratransform
import cv2
import numpy as np

from uavgram.estimation.first_poses.length_poses import LengthFrames, resect_from_lengths
from uavgram.estimation.survey.likelihood import compute_covariance_root
from uavgram.geometry.camera.projection import back_project, back_project_with_jacobian
from uavgram.geometry.ground.plane import intersect_ground_with_jacobian
from uavgram.geometry.motion.rotation import hat
from uavgram.model.arrays import Floats
from uavgram.model.survey import Survey

Work = tuple[Callable[[], object], int]
"""What is timed, and how many times in a row."""

HERE = Path(__file__).parent

ROUNDS, SHORT_ROUNDS = 7, 51
FRAMES = 1000
POINTS = 1_000_000
BLOCK = 4096
DRAWS = 100
MRCAL = """
import sys, time
import numpy as np, mrcal
parameters = np.array([float(a) for a in sys.argv[2:]])
pixel = np.random.default_rng(0).uniform([0, 0], [4000, 3000], (int(sys.argv[1]), 2))
mrcal.unproject(pixel[:100], "LENSMODEL_OPENCV5", parameters, get_gradients=True)
started = time.perf_counter()
mrcal.unproject(pixel, "LENSMODEL_OPENCV5", parameters, get_gradients=True)
print(time.perf_counter() - started)
"""


def timed(work: Callable[[], object], repeat: int = 1) -> float:
    started = time.perf_counter()
    for _ in range(repeat):
        work()
    return (time.perf_counter() - started) / repeat


def compare(ours: Work, peers: Sequence[Work], rounds: int = ROUNDS) -> tuple[Floats, Floats]:
    """Seconds of ours and of each peer (medians), and the median ratios peer / ours."""
    timed(*ours)  # warms up
    table = np.array([[timed(*work) for work in (ours, *peers)] for _ in range(rounds)])
    return np.median(table, axis=0), np.median(table[:, 1:] / table[:, :1], axis=0)


def one_frame() -> tuple[Survey, LengthFrames]:
    from scenes import make_scene

    pairs = tuple((k, k + 6) for k in range(6))
    survey = make_scene(0, frames=1, ends=pairs, telemetry=False, gauge="plane").survey
    at = np.full(len(survey.label), -1)
    at[survey.pick_label] = np.arange(len(survey.pick_label))
    return survey, LengthFrames(
        survey.pixel_px[None],
        survey.pick_sigma_px[None],
        at[survey.line_start][None],
        at[survey.line_end][None],
        survey.length_m[None],
        survey.length_sigma_m[None],
    )


def camera_transform(
    survey: Survey, frames: LengthFrames, plane: Floats
) -> tuple[Any, Callable[[], object]]:
    """Its fit: height, tilt and roll by Nelder-Mead; lens without tangential terms."""
    fx, fy, cx, cy, k1, k2, _, _, k3 = survey.calibration.parameters
    camera = cameratransform.Camera(
        cameratransform.RectilinearProjection(
            focallength_x_px=fx, focallength_y_px=fy, center_x_px=cx, center_y_px=cy,
            image=(survey.calibration.width_px, survey.calibration.height_px),
        ),
        cameratransform.SpatialOrientation(),
        cameratransform.BrownLensDistortion(k1=k1, k2=k2, k3=k3),
    )  # fmt: skip
    sigma = float(np.hypot(survey.length_sigma_m, 0.02).mean())
    start, end = (survey.pixel_px[ends[0]] for ends in (frames.start, frames.end))
    camera.addObjectLengthInformation(start, end, survey.length_m, sigma)
    height = 1 / np.linalg.norm(plane)
    tilt = np.degrees(np.arccos(plane[2] * height))
    fitted = [
        cameratransform.FitParameter("elevation_m", lower=5, upper=200, value=1.03 * height),
        cameratransform.FitParameter("tilt_deg", lower=0, upper=80, value=tilt),
        cameratransform.FitParameter("roll_deg", lower=-90, upper=90, value=0.0),
    ]
    return camera, lambda: camera.fit(fitted, method="Nelder-Mead")


def poses() -> None:
    import single_frame_ceres

    survey, frames = one_frame()
    calibration = survey.calibration
    best = resect_from_lengths(calibration, frames)
    start = 1.03 * best.plane
    root = compute_covariance_root(calibration.covariance)
    ray = back_project(calibration.model, calibration.parameters, survey.pixel_px)
    first = np.concatenate([ray[:, 0], ray[:, 1]])
    frame: single_frame_ceres.Frame = {
        "pixel": survey.pixel_px, "sigma": survey.pick_sigma_px, "start": frames.start[0],
        "end": frames.end[0], "length": survey.length_m, "length_sigma": survey.length_sigma_m,
    }  # fmt: skip

    def ceres() -> tuple[Floats, Floats, Floats, Any]:
        return single_frame_ceres.solve(calibration.parameters, root, frame, start[0], first)

    plane, _, joint, _ = ceres()
    sigma = np.sqrt(np.diag(best.covariance[0]))
    print(
        f"same optimum as Ceres to {np.abs((plane - best.plane[0]) / sigma).max():.1e} sigma, "
        f"sigmas to {np.abs(np.sqrt(np.diag(joint))[:3] / sigma - 1).max():.1e}"
    )
    _, nelder_mead = camera_transform(survey, frames, best.plane[0])
    ours = (lambda: resect_from_lengths(calibration, frames, start), 10)
    seconds, ratio = compare(ours, [(ceres, 10), (nelder_mead, 1)], SHORT_ROUNDS)
    print(
        f"one frame, six lines, with covariance: {1e3 * seconds[0]:.2f} ms; "
        f"Ceres {1e3 * seconds[1]:.2f} ms, ratio {ratio[0]:.2f} (bar 2); "
        f"CameraTransform {1e3 * seconds[2]:.0f} ms, ratio {ratio[1]:.0f} (bar 30)"
    )
    many = LengthFrames._make(np.repeat(column, FRAMES, axis=0) for column in frames)
    starts = np.repeat(start, FRAMES, axis=0)
    batch = (lambda: resect_from_lengths(calibration, many, starts), 1)
    seconds, ratio = compare(batch, [(ceres, 20)])
    print(
        f"{FRAMES} frames in one batch: {1e6 * seconds[0] / FRAMES:.0f} us a frame, "
        f"Ceres {1e6 * seconds[1]:.0f} us, ratio {FRAMES * ratio[0]:.1f} (bar 12)"
    )


def points() -> None:
    parameters = np.array([3000.0, 3000, 1999.5, 1499.5, -0.1, 0.02, 3e-4, -2e-4, 0.001])
    rotation, center = np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 50.0])
    root = np.random.default_rng(1).normal(size=(15, 15)) * 1e-3
    covariance = root @ root.T
    pixel = np.random.default_rng(0).uniform([0, 0], [4000, 3000], (POINTS, 2))
    matrix = np.array([[3000.0, 0, 1999.5], [0, 3000, 1499.5], [0, 0, 1]])

    def opencv() -> Floats:
        plain = cv2.undistortPoints(pixel, matrix, parameters[4:])[:, 0]
        ray = np.column_stack([plain, np.ones(POINTS)]) @ rotation.T
        place: Floats = center[:2] + ray[:, :2] * (-center[2] / ray[:, 2])[:, None]
        return place

    camera = cameratransform.Camera(
        cameratransform.RectilinearProjection(focallength_px=3000, image=(4000, 3000)),
        cameratransform.SpatialOrientation(elevation_m=50, tilt_deg=5),
        cameratransform.BrownLensDistortion(k1=-0.1, k2=0.02, k3=0.001),
    )
    some, rng = pixel[: POINTS // 100], np.random.default_rng(2)

    def resampled() -> Floats:
        drawn = []
        for height, tilt in rng.normal([50, 5], [0.1, 0.1], (DRAWS, 2)):
            camera.elevation_m, camera.tilt_deg = height, tilt
            drawn.append(camera.spaceFromImage(some)[:, :2])
        away = np.array(drawn) - np.mean(drawn, axis=0)
        spread: Floats = np.einsum("dni,dnj->nij", away, away) / (DRAWS - 1)
        return spread

    def propagated() -> Floats:
        """Propagate pose, lens and pixel as a run does, by the derivatives of the ground point."""
        made = []
        for rows in np.array_split(pixel, POINTS // BLOCK):
            ray, by_pixel, by_lens = back_project_with_jacobian("brown", parameters, rows)
            _, by_center, by_ray, _ = intersect_ground_with_jacobian(
                center, ray @ rotation.T, np.zeros(3), np.zeros(2)
            )
            turned = by_ray @ rotation
            parts = [by_center, -turned @ hat(ray), turned @ by_lens]
            jacobian = np.concatenate(parts, axis=2)[:, :2]
            noise = (turned @ by_pixel)[:, :2]
            spread = jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)
            made.append(spread + noise @ np.swapaxes(noise, 1, 2))
        return np.concatenate(made)

    cv2.setNumThreads(1)
    seconds, ratio = compare((propagated, 1), [(opencv, 1), (resampled, 1)])
    seconds, ratio = seconds / POINTS, ratio * [1, 100]
    print(
        f"ground points with 2x2 covariance: {1e-6 / seconds[0]:.2f} M/s; "
        f"OpenCV without {1e-6 / seconds[1]:.2f} M/s, share {ratio[0]:.2f}; "
        f"CameraTransform resampled {1e-8 / seconds[2]:.3f} M/s, ratio {ratio[1]:.0f} (bar 10)"
    )
    against_mrcal(parameters, propagated)


def against_mrcal(parameters: Floats, ours: Callable[[], object]) -> None:
    """Its process measures itself, in turn with ours."""
    python = shutil.which("python3", path="/usr/bin")
    points = POINTS // 10
    ratios, rates = [], []
    for _ in range(ROUNDS):
        arguments = [str(points), *(str(p) for p in parameters)]
        run = python and subprocess.run(
            [python, "-c", MRCAL, *arguments], capture_output=True, text=True, check=False
        )
        if not run or run.returncode:
            print("mrcal: left out, the system's Python has no mrcal (Debian: python3-mrcal)")
            return
        theirs = float(run.stdout) / points
        rates.append(1e-6 / theirs)
        ratios.append(theirs / (timed(ours) / POINTS))
    print(
        f"mrcal unproject with gradients {np.median(rates):.3f} M/s, "
        f"ratio {np.median(ratios):.1f} (bar 4)"
    )


if __name__ == "__main__":
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":  # it is read when numpy is loaded
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        sys.exit(
            subprocess.run([sys.executable, __file__], env=environment, check=False).returncode
        )
    sys.path[:0] = [str(HERE), str(HERE.parent / "support")]
    poses()
    points()
