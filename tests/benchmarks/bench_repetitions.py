"""Repetitions of one photo with six lengths: the batch beside scipy's solvers, in one run.

    python tests/benchmarks/bench_repetitions.py

All begin at the truth, have the same unknowns (a pose, twelve places) and stop at steps of 1e-7 of
their unknowns: the batch of `estimation/repeated/`, scipy's ``trf`` with numeric derivatives, and
its ``lm`` (MINPACK) with the batch's derivatives, written once more for one draw. Times are of the
processor, so that what else the machine does counts less; ratios are medians over rounds of
neighbouring runs. The largest difference of the minima stands beside them.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from photo_draws import (
    LENGTH_SIGMA_M,
    PIXEL_SIGMA_PX,
    POSE_SIGMA,
    Scene,
    photo_scene,
    start_of,
)

from uavgram.estimation.repeated.single_photo import adjust_photos
from uavgram.geometry.camera.projection import project_with_jacobian
from uavgram.geometry.motion.rotation import exp_so3, hat, right_jacobian
from uavgram.model.arrays import Floats

ROUNDS, DRAWS, NUMERIC, ANALYTIC = 5, 4000, 15, 150


def evaluated(scene: Scene, draw: int, unknown: Floats) -> tuple[Floats, Floats]:
    """Whitened residuals of one draw, and their Jacobian."""
    draws = scene.draws
    place, count = unknown[6:].reshape(-1, 2), draws.height_m.shape[1]
    rotation = draws.rotation[draw] @ exp_so3(unknown[3:6])
    height, *slope = draws.ground[draw]
    world = np.column_stack([place, height + place @ slope + draws.height_m[draw]])
    seen = (world - unknown[:3]) @ rotation
    camera = scene.shared.calibration
    pixel, by_seen, _ = project_with_jacobian(camera.model, camera.parameters, seen)
    by_world = by_seen @ rotation.T
    line = draws.line[draw]
    leg = world[line[:, 1]] - world[line[:, 0]]
    length = np.linalg.norm(leg, axis=1)
    residual = np.concatenate(
        [
            ((pixel - draws.pixel_px[draw]) / PIXEL_SIGMA_PX).ravel(),
            (length - draws.reading_m[draw]) / LENGTH_SIGMA_M,
            np.concatenate([unknown[:3] - draws.center[draw], unknown[3:6]]) / POSE_SIGMA,
        ]
    )
    jacobian = np.zeros((len(residual), len(unknown)))
    rows = jacobian[: 2 * count].reshape(count, 2, -1)
    rows[:, :, :3] = -by_world
    rows[:, :, 3:6] = by_seen @ hat(seen) @ right_jacobian(unknown[3:6])
    by_place = by_world[..., :2] + by_world[..., 2:] * slope
    each = np.arange(count)
    for k in (0, 1):
        rows[each, :, 6 + 2 * each + k] = by_place[..., k]
    rows /= PIXEL_SIGMA_PX
    along = (leg[:, :2] + leg[:, 2:] * slope) / length[:, None] / LENGTH_SIGMA_M
    at = 2 * count + np.arange(len(line))
    for sign, end in ((-1.0, line[:, 0]), (1.0, line[:, 1])):
        for k in (0, 1):
            jacobian[at, 6 + 2 * end + k] += sign * along[:, k]
    last = np.arange(6)
    jacobian[len(residual) - 6 + last, last] = 1.0 / POSE_SIGMA
    return residual, jacobian


def residual_of(scene: Scene, draw: int, unknown: Floats) -> Floats:
    """For scipy."""
    return evaluated(scene, draw, unknown)[0]


def jacobian_of(scene: Scene, draw: int, unknown: Floats) -> Floats:
    """For scipy."""
    return evaluated(scene, draw, unknown)[1]


def by_scipy(scene: Scene, draws: int, *, numeric: bool) -> Floats:
    """Centres (draws, 3) that scipy finds."""
    centers = []
    for draw in range(draws):
        found = least_squares(
            partial(residual_of, scene, draw),
            start_of(scene, draw),
            jac="2-point" if numeric else partial(jacobian_of, scene, draw),
            method="trf" if numeric else "lm",
            x_scale="jac",
            xtol=1e-7,
            ftol=1e-14,
            gtol=1e-14,
        )
        centers.append(found.x[:3])
    return np.array(centers)


def by_batch(scene: Scene, draws: int) -> Floats:
    """Centres (draws, 3) that the batch finds; all must come to rest."""
    found = adjust_photos(scene.shared, scene.draws, (scene.center, scene.rotation))
    if not found.converged.all():
        raise SystemExit(f"{int((~found.converged).sum())} draws did not come to rest")
    return found.center_world_m[:draws]


def rate(work: Callable[[int], Floats], draws: int) -> float:
    """Draws in a second of the processor's time."""
    begun = time.process_time()
    work(draws)
    return draws / (time.process_time() - begun)


def main() -> None:
    """Print rates and ratios."""
    scene = photo_scene(DRAWS)
    works: dict[str, tuple[Callable[[int], Floats], int]] = {
        "batch": (partial(by_batch, scene), DRAWS),
        "scipy trf, numeric derivatives": (partial(by_scipy, scene, numeric=True), NUMERIC),
        "scipy lm, analytic derivatives": (partial(by_scipy, scene, numeric=False), ANALYTIC),
    }
    for work, draws in works.values():
        work(min(draws, 5))
    rates = np.array([[rate(*one) for one in works.values()] for _ in range(ROUNDS)])
    ours = by_batch(scene, DRAWS)
    for k, (name, (work, draws)) in enumerate(works.items()):
        ratio = float(np.median(rates[:, 0] / rates[:, k]))
        few = min(draws, NUMERIC)
        off = np.abs(work(few) - ours[:few]).max()
        print(
            f"{name:32s} {np.median(rates[:, k]):9.0f} draws/s   batch is {ratio:6.1f} times as "
            f"fast   centres differ by {1e6 * off:.3f} micrometres"
        )


if __name__ == "__main__":
    main()
