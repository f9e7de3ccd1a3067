"""A study's scene as one photo: where everything lies, what is drawn, what is left unsaid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.geometry.camera.lens import distort
from uavgram.geometry.camera.projection import project
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera.calibration import Calibration
from uavgram.model.options import GroundOptions
from uavgram.model.simulation.photo import PhotoDesign, PhotoDraws
from uavgram.model.study.scene import StudyScene
from uavgram.pipeline.study.method_scenes import AREA_M, FOCAL_PX, LOG_SIGMA, SIZE_PX

WANTED, SHORTEST_M = 16, 5.0
"""Distances that are measured, and the shortest of them."""

RELIEF_LENGTH_M = 5.0
EDGE = 0.75
"""Of the half area: how far out `spread` lengths lie."""

TURN = np.pi * (np.sqrt(5.0) - 1.0) / 2.0
"""From one length to the next where they do not lie around the scene: the golden section of half a
turn, so that few have all directions, and more of them have the few among them."""

BEFOREHAND = {
    # Nothing is known: so weak that it moves no length.
    "none": np.array([100.0, 100.0, 1000.0, 10.0, 10.0, 10.0]),
    "consumer": np.array(LOG_SIGMA),
    "rtk": np.array([0.05, 0.05, 0.08, *LOG_SIGMA[3:]]),
}
"""Sigmas of the log's pose: centre [m], turn about the camera's axes [rad]."""

GROUND = np.diag([GroundOptions.height_sigma_m, *[np.deg2rad(GroundOptions.slope_sigma_deg)] * 2])
"""How well the ground's plane is known beforehand: as projects have it that state nothing."""

LENS = np.array([FOCAL_PX, FOCAL_PX, (SIZE_PX[0] - 1) / 2, (SIZE_PX[1] - 1) / 2, 0, 0, 0, 0, 0])


@dataclass(frozen=True)
class Photo:
    """A scene's geometry: design, true pose, true places (E, 2), measured pairs (M, 2)."""

    scene: StudyScene
    design: PhotoDesign
    center: Floats
    rotation: Floats
    place_m: Floats
    pairs: Ints


def photo_of(scene: StudyScene) -> Photo:
    """Where everything lies.

    Parameters
    ----------
    scene
        The photo.

    Raises
    ------
    ValueError
        Something of it lies outside the photo.
    """
    ends, line = _taped(scene)
    wanted = _wanted()
    place = np.concatenate([ends, wanted.reshape(-1, 2)])
    pairs = len(ends) + np.arange(2 * WANTED).reshape(-1, 2)
    tilt = np.deg2rad(scene.tilt_deg)
    center = np.array([0.0, -scene.height_m * np.tan(tilt), scene.height_m])
    # Image up is north; tilting lifts the view from straight down to the north.
    rotation = exp_so3(np.array([tilt, 0.0, 0.0])) @ np.diag([1.0, -1.0, -1.0])
    pixel = _exactly(place, center, rotation)
    if not (np.all(pixel > 0) and np.all(pixel < np.array(SIZE_PX))):
        raise ValueError(f"not everything is in the photo: {scene}")
    sigma = np.full(len(place), scene.pick_px)
    sigma[: len(ends)] = scene.mark_px or scene.pick_px
    design = PhotoDesign(
        calibration=Calibration(
            name="study",
            model="brown",
            width_px=SIZE_PX[0],
            height_px=SIZE_PX[1],
            parameters=LENS,
            covariance=np.zeros((9, 9)),
        ),
        height_m=np.zeros(len(place)),
        line=line,
        pixel_sigma_px=sigma,
        length_sigma_m=np.full(len(line), scene.tape_m),
        information=np.diag(BEFOREHAND[scene.log] ** -2.0),
        camera_root=_camera_root(scene),
        # A log says where the camera is, and only this where the ground: without one the plane is
        # what everything is measured from.
        ground_root=None if scene.log == "none" else GROUND,
        tape_scale_sigma=scene.tape_scale,
    )
    return Photo(scene, design, center, rotation, place, pairs)


def exact_draw(photo: Photo) -> PhotoDraws:
    """The photo without any error.

    Parameters
    ----------
    photo
        The geometry.
    """
    pixel = _exactly(photo.place_m, photo.center, photo.rotation)
    return PhotoDraws(
        pixel_px=pixel[None],
        length_m=_lengths(photo.place_m, photo.design.line)[None],
        center_world_m=photo.center[None],
        world_from_camera=photo.rotation[None],
        ground=np.zeros((1, 3)),
    )


def draw(photo: Photo, count: int, rng: np.random.Generator) -> tuple[PhotoDraws, Floats]:
    """Draws with all errors of the scene, and (B, M) the true distances.

    Parameters
    ----------
    photo, count
        What is drawn, how many times.
    rng
        Of the draws.
    """
    scene, design = photo.scene, photo.design
    up = _relief(photo, count, rng)
    lens = np.repeat(LENS[:, None], count, axis=1)
    if design.camera_root is not None:
        lens += design.camera_root @ rng.standard_normal((design.camera_root.shape[1], count))
    lens[4] += scene.bulge
    pixel = _read_out(photo, lens, up)
    noise = rng.standard_normal(pixel.shape) * design.pixel_sigma_px[:, None]
    world = np.concatenate(
        [np.broadcast_to(photo.place_m, (count, *photo.place_m.shape)), up[..., None]], axis=2
    )
    length = _lengths(world, design.line)
    reading = length + design.length_sigma_m * rng.standard_normal(length.shape)
    # A tape of scale s reads l / (1 + s).
    reading /= 1.0 + scene.tape_scale * rng.standard_normal((count, 1))
    reading[:, 0] += scene.blunder_m
    off = BEFOREHAND[scene.log] * rng.standard_normal((count, 6))
    if scene.log == "none":
        off *= 0.0
    ground = np.zeros((count, 3))
    if design.ground_root is not None:
        ground += rng.standard_normal((count, 3)) @ design.ground_root.T
    draws = PhotoDraws(
        pixel_px=pixel + noise,
        length_m=reading,
        center_world_m=photo.center + off[:, :3],
        # true = beforehand @ exp(error)
        world_from_camera=photo.rotation @ exp_so3(-off[:, 3:]),
        ground=ground,
    )
    return draws, _lengths(world, photo.pairs)


def _exactly(place_m: Floats, center: Floats, rotation: Floats) -> Floats:
    """(E, 2) pixels of places on level ground by the lens as stated."""
    world = np.column_stack([place_m, np.zeros(len(place_m))])
    return project("brown", LENS, (world - center) @ rotation)


def _camera_root(scene: StudyScene) -> Floats | None:
    """Columns: the focal length, and both coordinates of the principal point."""
    root = np.zeros((9, 3))
    root[:2, 0] = scene.focal_share * FOCAL_PX
    root[2, 1] = root[3, 2] = scene.centre_px
    kept = root[:, np.any(root != 0, axis=0)]
    return kept if kept.size else None


def _taped(scene: StudyScene) -> tuple[Floats, Ints]:
    """Ends (E, 2) of the taped lengths, and which of them belong together (L, 2)."""
    turn = 2 * np.pi * (np.arange(scene.lines) + 0.5) / scene.lines
    out = np.array([np.cos(turn), np.sin(turn)]).T * np.array(AREA_M) / 2 * EDGE
    if scene.layout == "plates":
        half = scene.line_m / 2
        corner = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        known = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]])
        first = 4 * np.arange(scene.lines)[:, None, None]
        return (out[:, None] + corner).reshape(-1, 2), (first + known).reshape(-1, 2)
    along = np.array([-np.sin(turn), np.cos(turn)]).T
    if scene.layout != "spread":
        rng = np.random.default_rng(1902)
        low, high = {"corner": ((-0.9, -0.9), (-0.3, -0.3)), "side": ((-0.8, -0.9), (0.8, -0.5))}[
            scene.layout
        ]
        out = rng.uniform(low, high, (scene.lines, 2)) * np.array(AREA_M) / 2
        angle = TURN * np.arange(scene.lines)
        along = np.array([np.cos(angle), np.sin(angle)]).T
    reach = scene.line_m / 2 * along
    ends = np.stack([out - reach, out + reach], axis=1).reshape(-1, 2)
    return ends, np.arange(2 * scene.lines).reshape(-1, 2)


def _wanted() -> Floats:
    """(M, 2, 2) ends of the measured distances: the same in all scenes."""
    drawn = np.random.default_rng(1901).uniform(-0.5, 0.5, (200, 2, 2)) * np.array(AREA_M)
    length = np.linalg.norm(drawn[:, 1] - drawn[:, 0], axis=1)
    return np.asarray(drawn[length >= SHORTEST_M][:WANTED])


def _lengths(place_m: Floats, pairs: Ints) -> Floats:
    return np.asarray(
        np.linalg.norm(place_m[..., pairs[:, 1], :] - place_m[..., pairs[:, 0], :], axis=-1)
    )


def _relief(photo: Photo, count: int, rng: np.random.Generator) -> Floats:
    """(B, E) heights of the ends: normal, with a Gaussian covariance."""
    size = photo.scene.relief_m
    if not size:
        return np.zeros((count, len(photo.place_m)))
    apart = np.linalg.norm(photo.place_m[:, None] - photo.place_m[None], axis=2)
    alike = np.exp(-0.5 * (apart / RELIEF_LENGTH_M) ** 2) + 1e-9 * np.eye(len(apart))
    drawn = rng.standard_normal((count, len(apart)))
    return np.asarray(size * drawn @ np.linalg.cholesky(alike).T)


def _read_out(photo: Photo, lens: Floats, up: Floats) -> Floats:
    """(B, E, 2) pixels, row v being exposed readout (v / height - 1/2) after the photo's middle."""
    scene = photo.scene
    pixel = _seen(lens, photo.place_m, up, photo.center, photo.rotation)
    if not scene.readout_ms:
        return pixel
    speed = np.array([0.0, scene.speed_m_s, 0.0])
    for _ in range(3):
        late = 1e-3 * scene.readout_ms * (pixel[..., 1] / SIZE_PX[1] - 0.5)
        at = photo.center + late[..., None] * speed
        pixel = _seen(lens, photo.place_m, up, at, photo.rotation)
    return pixel


def _seen(lens: Floats, place_m: Floats, up_m: Floats, center: Floats, rotation: Floats) -> Floats:
    """(B, E, 2) pixels by B lenses (9, B) of places (E, 2) at heights (B, E).

    All from one centre (3,), or each from its own (B, E, 3). Nothing here lies beyond the lens's
    fold or behind the camera, which `project` would look for.
    """
    place = np.broadcast_to(place_m, (*up_m.shape, 2))
    x, y, ahead = np.moveaxis((np.dstack([place, up_m]) - center) @ rotation, 2, 0)
    fx, fy, cx, cy = lens[:4, :, None]
    lens_at = distort("brown", lens[4:, :, None], x / ahead, y / ahead)
    return np.stack([fx * lens_at.x + cx, fy * lens_at.y + cy], axis=2)
