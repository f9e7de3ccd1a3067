"""Surveys whose photos state their places and nothing else, with known truth.

Pixels come from OpenCV, rotations from scipy; every photo is turned as it likes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pyproj import Transformer
from scenes import calibration_covariance, cv_pixels
from scipy.spatial.transform import Rotation

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observed import Observations
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration
from uavgram.model.frames import Frames, PhotoPoses, Telemetry
from uavgram.model.observations import KnownLines, Picks
from uavgram.model.options import GroundOptions, MountOptions, TelemetryOptions
from uavgram.model.survey import Survey
from uavgram.stages.assemble import assemble
from uavgram.stages.seed import seed
from uavgram.stages.seed.photo_exposures import place_photos

SIZE_PX = (2400, 1800)
LENS = np.array([1700.0, 1702.0, 1198.0, 901.0, -0.02, 0.01, 2e-4, -1e-4, 0.0])
PLACE = (47.0, 8.0, 400.0)
TO_EARTH = Transformer.from_pipeline(
    "+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 "
    f"+lat_0={PLACE[0]} +lon_0={PLACE[1]} +h_0={PLACE[2]} +step +inv +proj=cart +ellps=WGS84"
)


@dataclass(frozen=True)
class PlaceOnly:
    """A survey, and the true centres (F, 3), rotations (F, 3, 3) and points (K, 3)."""

    survey: Survey
    center: Floats
    rotation: Floats
    world: Floats

    def pose_errors(self, adjustment: Adjustment) -> Floats:
        """(F, 6) centre [m] and turn in the camera [rad], estimated to true, over their sigmas."""
        names = adjustment.survey.frame_id
        at = [self.survey.frame_id.index(name) for name in names]
        turn = np.swapaxes(adjustment.state.rotation, 1, 2) @ self.rotation[at]
        error = np.concatenate(
            [
                self.center[at] - adjustment.state.center,
                Rotation.from_matrix(turn).as_rotvec(),
            ],
            axis=1,
        )
        sigma = np.sqrt(np.einsum("fii->fi", adjustment.frame_covariance()))
        in_sigmas: Floats = error / sigma
        return in_sigmas


def place_only(
    seed_: int,
    *,
    frames: int = 6,
    labels: int = 14,
    pitch_deg: float = -90.0,
    mount_pitch_deg: float | None = None,
    attitude_sigma_deg: tuple[float, float] | Literal["auto"] = "auto",
    ground: GroundOptions | None = None,
    raised_m: tuple[float, ...] = (),
) -> PlaceOnly:
    """Photos minutes apart and 40 m up; each picks what it sees of the labels, to 1 px.

    `mount_pitch_deg`: what the project says of their tilt, where that is not true. `raised_m`:
    heights of the last labels, which the picks do not state.
    """
    rng = np.random.default_rng((421, seed_))
    ground = ground or GroundOptions()
    rough = rng.normal(0.0, ground.roughness_sigma_m or 1e-9, labels)
    world = np.column_stack([rng.uniform(-18, 18, (labels, 2)), rough])
    world[labels - len(raised_m) :, 2] += raised_m
    center, rotation = _cameras(rng, frames, pitch_deg)
    bias = rng.normal(0, [2.0, 2.0, 3.0])
    lens = Calibration(
        name="c",
        model="brown",
        width_px=SIZE_PX[0],
        height_px=SIZE_PX[1],
        parameters=LENS,
        covariance=calibration_covariance(),
    )
    image, label, pixel = [], [], []
    true_lens = rng.multivariate_normal(LENS, calibration_covariance(), method="svd")
    for k in range(frames):
        camera = (world - center[k]) @ rotation[k]
        seen, _ = cv_pixels(true_lens, center[k], rotation[k], world)
        seen = seen + rng.normal(0, 1, (labels, 2))
        inside = (camera[:, 2] > 1) & (np.abs(camera[:, :2]) < camera[:, 2:] * [0.7, 0.53]).all(1)
        for i in np.flatnonzero(inside):
            image.append(f"p{k}.jpg")
            label.append(f"L{i:02d}")
            pixel.append(seen[i])
    picks = Picks(
        image=tuple(image),
        label=tuple(label),
        pixel_px=np.array(pixel),
        sigma_px=np.ones(len(image)),
        height_m=np.full(len(image), np.nan),
    )
    poses = _poses(center + bias + rng.normal(0, 3.0, center.shape))
    telemetry = TelemetryOptions(attitude_sigma_deg=attitude_sigma_deg)
    mount = MountOptions(pitch_deg=pitch_deg if mount_pitch_deg is None else mount_pitch_deg)
    exposures, _ = place_photos(poses, PLACE, mount, telemetry)
    seeds = seed(_frames(exposures.frame_id), exposures, mount, telemetry)
    picked = [name for name in exposures.frame_id if name in image]
    observed = Observations(
        calibration=lens,
        picks=picks,
        lines=_lines(rng, world),
        telemetry=Telemetry(poses=seeds.poses, prior=seeds.prior, track=exposures),
        ground=ground,
        picks_sigma_px=1.0,
    )
    assembled = assemble(observed)
    at = [int(name[1:-4]) for name in picked]
    return PlaceOnly(assembled.survey, center[at], rotation[at], world)


def _cameras(rng: np.random.Generator, frames: int, pitch_deg: float) -> tuple[Floats, Floats]:
    """Each anywhere about the scene, turned as it likes, tilted as the mount has it up to 5."""
    heading = rng.uniform(0, 360, frames)
    away = 40.0 / np.tan(np.radians(-pitch_deg)) if pitch_deg > -85 else 0.0
    look = np.column_stack([np.sin(np.radians(heading)), np.cos(np.radians(heading))])
    planar = rng.uniform(-12, 12, (frames, 2)) - away * look
    center = np.column_stack([planar, rng.uniform(34, 46, frames)])
    tilt = rng.normal(0, 4.0, (frames, 2))
    angles = np.column_stack([heading, pitch_deg + tilt[:, 0], tilt[:, 1]])
    ned = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
    enu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    return center, enu @ ned @ np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0.0]])


def _poses(place_m: Floats) -> PhotoPoses:
    longitude, latitude, height = TO_EARTH.transform(place_m[:, 0], place_m[:, 1], place_m[:, 2])
    count = len(place_m)
    unknown, none = np.full(count, np.nan), np.full((count, 3), np.nan)
    return PhotoPoses(
        frame_id=tuple(f"p{k}.jpg" for k in range(count)),
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        height_home_m=unknown,
        datum="msl",
        datum_guess="",
        time_utc_s=unknown,
        ypr_rad=none,
        vehicle_ypr_rad=none,
        sigma_horizontal_m=unknown,
        sigma_vertical_m=unknown,
        sigma_attitude_rad=unknown,
        source="EXIF GPS",
    )


def _frames(names: tuple[str, ...]) -> Frames:
    return Frames(
        frame_id=names,
        time_utc_s=np.full(len(names), np.nan),
        sigma_time_s=np.full(len(names), np.nan),
        matched=np.ones(len(names), dtype=bool),
        reason=("",) * len(names),
        clock_offset_s=0.0,
        clock_offset_sigma_s=1.0,
    )


def _lines(rng: np.random.Generator, world: Floats) -> KnownLines:
    ends = [(0, 1), (2, 3), (4, 5), (6, 7)]
    length = np.array([np.linalg.norm(world[a] - world[b]) for a, b in ends])
    return KnownLines(
        name=tuple(f"R{k}" for k in range(4)),
        start=tuple(f"L{a:02d}" for a, _ in ends),
        end=tuple(f"L{b:02d}" for _, b in ends),
        length_m=length + rng.normal(0, 0.01, 4),
        sigma_m=np.full(4, 0.01),
        adjust=np.ones(4, dtype=bool),
    )
