"""Points of rendered streets in pairs of photos: their predictions, and the truth."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from uavgram.geometry.camera.projection import back_project, project
from uavgram.geometry.motion.rotation import exp_so3, log_so3
from uavgram.imaging.matching.least_squares import SoughtPoints
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Bools, Floats

GROUND_SIGMA_M = 0.08
STEP_PX = 4.0
STEP_M = 0.01
STEP_RAD = 1e-4
ROWS = 1800


@dataclass(frozen=True, kw_only=True)
class PoseError:
    """Standard deviations of a pose: per axis of the centre [m], and of the attitude [rad]."""

    center_m: float
    angle_rad: float

    @staticmethod
    def of(center_m: float, angle_deg: float) -> PoseError:
        return PoseError(center_m=center_m, angle_rad=float(np.deg2rad(angle_deg)))


AFTER = PoseError.of(0.03, 0.05)
BEFORE = PoseError.of(1.0, 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Pair:
    """Points that two photos show.

    Attributes
    ----------
    source, target
        Names of the photos.
    label
        n of the points.
    sought
        What is predicted, the source's pixels being exact.
    true_px
        (n, 2) in the target.
    """

    source: str
    target: str
    label: tuple[str, ...]
    sought: SoughtPoints
    true_px: Floats


@dataclass(frozen=True, eq=False)
class StreetTruth:
    """A rendered street: its photos, their true poses, its points."""

    folder: Path
    truth: dict[str, Any]

    @staticmethod
    def read(data: Path, name: str) -> StreetTruth:
        text = (data / "truth" / f"{name}.json").read_text(encoding="utf-8")
        return StreetTruth(data / name / "photos", json.loads(text))

    @staticmethod
    def rendered(folder: Path) -> StreetTruth:
        """A flight of tests/support/streets, its folder holding photos and truth.json."""
        truth = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
        for frame in truth["frames"].values():
            frame["rows"] = [_row(frame, row, truth["readout_s"]) for row in (0.0, ROWS - 1.0)]
        ground = np.array([at for label, at in truth["points"].items() if label[0] in "PQZD"])
        middle = ground.mean(axis=0)
        slope = np.linalg.lstsq(ground[:, :2] - middle[:2], ground[:, 2] - middle[2])[0]
        truth["ground"] = {
            "height_m": middle[2],
            "slope": slope.tolist(),
            "pivot": middle[:2].tolist(),
        }
        truth["kinds"] = {label: label[0] for label in truth["points"]}
        return StreetTruth(folder / "photos", truth)

    @cached_property
    def lens(self) -> Floats:
        return np.array(self.truth["intrinsics"])

    @property
    def frames(self) -> list[str]:
        return list(self.truth["frames"])

    def photo(self, frame: str) -> Image:
        flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        grey = cv2.imread(str(self.folder / frame), flags)
        assert grey is not None
        return np.asarray(grey, np.uint8)

    def visible(self, frame: str) -> dict[str, Floats]:
        return {
            label: np.array(place[:2])
            for label, place in self.truth["pixels"][frame].items()
            if place[2]
        }

    def pairs(self, labels: set[str], error: PoseError, rng: np.random.Generator) -> Iterator[Pair]:
        """Of all ordered pairs of photos, with poses that err anew for each photo."""
        off = {
            frame: np.concatenate(
                [rng.normal(0, error.center_m, 3), rng.normal(0, error.angle_rad, 3)]
            )
            for frame in self.frames
        }
        for source in self.frames:
            for target in self.frames:
                seen = self.visible(source), self.visible(target)
                both = tuple(sorted(labels & seen[0].keys() & seen[1].keys()))
                if source == target or not both:
                    continue
                place, true = (np.array([own[label] for label in both]) for own in seen)
                sought = self._sought((source, target), place, (off[source], off[target]), error)
                yield Pair(source=source, target=target, label=both, sought=sought, true_px=true)

    def _sought(
        self, frames: tuple[str, str], place: Floats, off: tuple[Floats, Floats], error: PoseError
    ) -> SoughtPoints:
        def mapped(pixel: Floats, first: Floats, second: Floats, up: float) -> Floats:
            return self._seen(frames[1], self._ground(frames[0], pixel, first, up), second)

        first, second = off
        affine = np.stack(
            [
                (mapped(place + d, first, second, 0.0) - mapped(place - d, first, second, 0.0))
                / (2 * STEP_PX)
                for d in STEP_PX * np.eye(2)
            ],
            axis=-1,
        )
        here = mapped(place, first, second, 0.0)
        columns = [(mapped(place, first, second, STEP_M) - here) / STEP_M * GROUND_SIGMA_M]
        steps = np.repeat([STEP_M, STEP_RAD], 3)
        sigma = np.repeat([error.center_m, error.angle_rad], 3)
        for axis, step in enumerate(np.diag(steps)):
            scale = sigma[axis] / steps[axis]
            columns.append((mapped(place, first + step, second, 0.0) - here) * scale)
            columns.append((mapped(place, first, second + step, 0.0) - here) * scale)
        by = np.stack(columns, axis=-1)
        covariance = by @ np.swapaxes(by, 1, 2)
        return SoughtPoints(
            source_px=place,
            target_px=here,
            covariance_px2=covariance,
            affine=affine,
            rise=by[:, :, 0] / GROUND_SIGMA_M,
            is_confirmed=np.zeros(len(place), dtype=np.bool_),
        )

    def _poses(self, frame: str, row: Floats, off: Floats) -> tuple[Floats, Floats]:
        """Centres (n, 3) and world-from-camera (n, 3, 3) at rows, wrong by a 6-vector."""
        rows = self.truth["frames"][frame]["rows"]
        ends = [(np.array(r["center_world_m"]), np.array(r["world_from_camera"])) for r in rows]
        share = (row - rows[0]["row"]) / (rows[-1]["row"] - rows[0]["row"])
        center = ends[0][0] + share[:, None] * (ends[-1][0] - ends[0][0]) + off[:3]
        turn = log_so3(ends[0][1].T @ ends[-1][1])
        return center, ends[0][1] @ exp_so3(share[:, None] * turn) @ exp_so3(off[3:])

    def _ground(self, frame: str, pixel: Floats, off: Floats, up: float) -> Floats:
        center, turn = self._poses(frame, pixel[:, 1], off)
        ray = (turn @ back_project("brown", self.lens, pixel)[..., None])[..., 0]
        ground = self.truth["ground"]
        normal = np.array([-ground["slope"][0], -ground["slope"][1], 1.0])
        foot = np.array([*ground["pivot"], ground["height_m"] + up])
        depth = ((foot - center) @ normal) / (ray @ normal)
        return np.asarray(center + ray * depth[:, None])

    def _seen(self, frame: str, world: Floats, off: Floats) -> Floats:
        row = np.full(len(world), 900.0)
        for _ in range(3):  # a rolling shutter's row is that of the pixel
            center, turn = self._poses(frame, row, off)
            camera = np.einsum("nji,nj->ni", turn, world - center)
            pixel = project("brown", self.lens, camera)
            row = pixel[:, 1]
        return pixel


def _row(frame: dict[str, Any], row: float, readout_s: float) -> dict[str, Any]:
    """The pose at a row, exposed at readout (row - (rows - 1) / 2) / rows after the middle one."""
    after = readout_s * (row - (ROWS - 1) / 2) / ROWS
    center = np.array(frame["center_world_m"]) + after * np.array(frame["velocity_world_m_s"])
    turn = np.array(frame["world_from_camera"])
    turn = turn @ exp_so3(after * np.array(frame["rate_camera_rad_s"]))
    return {"row": row, "center_world_m": center, "world_from_camera": turn}


def inside(pixel_px: Floats, photo: Image, margin: float) -> Bools:
    """Whether pixels (n, 2) are so far within a photo."""
    edge = np.array(photo.shape[1::-1]) - 1 - margin
    return np.asarray(((pixel_px >= margin) & (pixel_px <= edge)).all(axis=1))
