"""Flights over a rendered street, and the camera: poses at any instant, pixels of points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from hostile_world import Smooth
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation

from uavgram.model.arrays import Floats

Kind = Literal["nadir", "oblique", "orbit"]
CAMERA_FROM_GIMBAL = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
STREET_FROM_NED = np.diag([1.0, -1.0, -1.0])
"""In the street frame north is s: x ahead, y to the right, z down."""
_AWAY_S = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class Camera:
    """Size, true lens (9,) in OpenCV's order (fx fy cx cy k1 k2 p1 p2 k3), shutter."""

    width_px: int
    height_px: int
    lens: Floats
    readout_s: float = 0.0

    def pixels(self, point: Floats) -> Floats:
        """(n, 2) pixels of points in the camera frame; NaN behind it."""
        matrix = np.array(
            [[self.lens[0], 0, self.lens[2]], [0, self.lens[1], self.lens[3]], [0, 0, 1]]
        )
        zero = np.zeros(3)
        pixel, _ = cv2.projectPoints(
            np.ascontiguousarray(point[:, None]), zero, zero, matrix, self.lens[4:]
        )
        result = np.asarray(pixel[:, 0], np.float64)
        bent = np.hypot(point[:, 0], point[:, 1]) > 1.6 * point[:, 2]  # far beyond the photo
        result[(point[:, 2] <= 0.1) | bent] = np.nan
        return result

    def plain(self) -> Floats:
        """(H, W, 2) x and y of the rays of all pixels, z = 1."""
        h, w = self.height_px, self.width_px
        step = 4  # rays bend slowly: every fourth, and cubic between
        u, v = np.meshgrid(np.arange(-2, w // step + 4), np.arange(-2, h // step + 4))
        pixel = step * np.stack([u, v], axis=-1).reshape(-1, 1, 2).astype(np.float64)
        matrix = np.array(
            [[self.lens[0], 0, self.lens[2]], [0, self.lens[1], self.lens[3]], [0, 0, 1]]
        )
        rule = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-12)
        ray = cv2.undistortPoints(pixel, matrix, self.lens[4:], criteria=rule)
        knots = np.asarray(ray, np.float64).reshape(*u.shape, 2)
        across = CubicSpline(step * u[0], knots, axis=1)(np.arange(w))
        return np.asarray(CubicSpline(step * v[:, 0], across, axis=0)(np.arange(h)))


def camera(width_px: int, height_px: int, readout_s: float, rng: np.random.Generator) -> Camera:
    """A camera of the usual field of view, with distortion."""
    scale = width_px / 2400
    lens = np.array([1800.0, 1801.0, 1204.0, 893.0, -0.08, 0.03, 3e-4, -2e-4, 0.0])
    lens[:4] = lens[:4] * scale + 0.5 * (scale - 1) * np.array([0, 0, 1, 1])
    lens += rng.normal(0, [2.4 * scale, 0, 1.6 * scale, 1.6 * scale, 1.5e-3, 3e-3, 1e-4, 1e-4, 0])
    lens[1] = lens[0] * 1.0004
    return Camera(width_px=width_px, height_px=height_px, lens=lens, readout_s=readout_s)


class Flight:
    """Where the camera is and how it looks, as smooth functions of time, in the street frame.

    Parameters
    ----------
    time_s
        (n,) instants of the way.
    place
        (n, 3) the camera then.
    yaw, pitch
        (n,) degrees: of the optical axis, clockwise from s; -90 looks down.
    exposure_s
        (f,) instants of the photos.
    rng
        Draws the wind.
    """

    def __init__(
        self,
        time_s: Floats,
        place: Floats,
        angles: tuple[Floats, Floats],
        exposure_s: Floats,
        rng: np.random.Generator,
    ) -> None:
        self.exposure_s = exposure_s
        self.start_s, self.end_s = float(time_s[0]), float(time_s[-1])
        self._way = CubicSpline(time_s, place)
        self._yaw, self._pitch = (PchipInterpolator(time_s, angle) for angle in angles)
        self._drift = Smooth(rng, np.array([0.5, 0.5, 0.4]), 4.0)
        self._shake = Smooth(rng, np.array([1.2, 1.2, 1.0]), 1.5)  # yaw, pitch, roll, degrees

    def center(self, time: Floats) -> Floats:
        """(n, 3) camera."""
        return np.asarray(self._way(time) + self._drift(time))

    def velocity(self, time: Floats) -> Floats:
        """(n, 3) of it."""
        return np.asarray((self.center(time + _AWAY_S) - self.center(time - _AWAY_S)) / 2 / _AWAY_S)

    def ned_from_mount(self, time: Floats) -> Rotation:
        """Gimbal axes (x looks, z down when level), from ahead, right, down."""
        yaw, pitch, roll = self._shake(time).T
        angles = np.column_stack([self._yaw(time) + yaw, self._pitch(time) + pitch, roll])
        return Rotation.from_euler("ZYX", angles, degrees=True)

    def rotation(self, time: Floats) -> Rotation:
        """Camera to street."""
        turn = STREET_FROM_NED @ self.ned_from_mount(time).as_matrix() @ CAMERA_FROM_GIMBAL.T
        return Rotation.from_matrix(turn)

    def rate(self, time: Floats) -> Floats:
        """(n, 3) angular velocity in camera axes."""
        before, after = self.rotation(time - _AWAY_S), self.rotation(time + _AWAY_S)
        return np.asarray((before.inv() * after).as_rotvec() / 2 / _AWAY_S)


def fly(kind: Kind, photos: int, height_m: float, rng: np.random.Generator) -> Flight:
    """Draw a flight of so many photos at a height above the road.

    Parameters
    ----------
    kind
        nadir: strips to and fro with 75 % overlap; oblique: strips looking ahead 45 degrees;
        orbit: an arc about the middle.
    photos
        How many.
    height_m
        Above the road.
    rng
        Draws its wind.
    """
    strips = 1 if photos <= 12 else 2 if photos <= 20 else 4
    each = -(-photos // strips)
    if kind == "orbit":
        angle = np.deg2rad(np.arange(photos) * min(360 / photos, 14.0) + rng.uniform(0, 360))
        radius = height_m * rng.uniform(0.9, 1.1)
        place = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
        yaw = np.rad2deg(-angle) + 180.0  # back to the middle; clockwise is -t
        pitch = np.full(photos, -45.0)
    else:
        step, aside = (0.25, 0.45) if kind == "nadir" else (0.2, 0.35)
        rows = []
        for strip in range(strips):
            along = (np.arange(each) - (each - 1) / 2) * step * height_m
            t = (strip - (strips - 1) / 2) * aside * height_m + rng.normal(0, 1.0)
            rows.append(np.column_stack([along[:: -1 if strip % 2 else 1], np.full(each, t)]))
        place = np.concatenate(rows)[:photos]
        back = (np.arange(photos) // each) % 2 * 180.0
        yaw = back if kind == "nadir" else np.zeros(photos)
        pitch = np.full(photos, -90.0 if kind == "nadir" else -45.0)
        if kind == "oblique":
            place = place - [height_m, 0.0]
        yaw = yaw + rng.normal(0, 5)
    steps = np.linalg.norm(np.diff(place, axis=0), axis=1) / rng.uniform(4, 7)
    exposure = 20.0 + np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1.2))])
    # The way begins and ends a little before and after.
    time = np.concatenate([[exposure[0] - 4], exposure, [exposure[-1] + 4]])
    way = np.concatenate(
        [[2 * place[0] - place[min(1, photos - 1)]], place, [2 * place[-1] - place[-2]]]
    )
    way = np.column_stack([way, np.full(len(way), height_m)])
    ends = np.concatenate([[0], np.arange(photos), [photos - 1]])
    return Flight(time, way, (yaw[ends], pitch[ends]), exposure, rng)


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """One photo: the camera's motion about its exposure, in the street frame.

    Row v is exposed at readout (v - (height - 1) / 2) / height after the exposure: the centre has
    moved on by velocity, the rotation by exp(rate).
    """

    camera: Camera
    center: Floats
    rotation: Floats
    velocity: Floats
    rate: Floats

    def late_s(self, row: Floats) -> Floats:
        """(n,) time of rows after the exposure."""
        size = self.camera.height_px
        return np.asarray(self.camera.readout_s * (row - (size - 1) / 2) / size)

    def poses(self, row: Floats) -> tuple[Floats, Floats]:
        """Centres (n, 3) and rotations camera to street (n, 3, 3) of rows (n,)."""
        late = self.late_s(row)[:, None]
        turn = Rotation.from_matrix(self.rotation) * Rotation.from_rotvec(late * self.rate)
        return self.center + late * self.velocity, np.asarray(turn.as_matrix())

    def pixels(self, point: Floats) -> Floats:
        """(n, 2) exact pixels of points (n, 3); NaN behind the camera."""
        row = np.full(len(point), (self.camera.height_px - 1) / 2)
        pixel = np.full((len(point), 2), np.nan)
        for _ in range(8 if self.camera.readout_s else 1):
            center, rotation = self.poses(np.nan_to_num(row))
            pixel = self.camera.pixels(np.einsum("nji,nj->ni", rotation, point - center))
            row = pixel[:, 1]
        return pixel


def views(flight: Flight, taken_by: Camera) -> tuple[View, ...]:
    """All photos of a flight."""
    at = flight.exposure_s
    parts = zip(
        flight.center(at), flight.rotation(at).as_matrix(), flight.velocity(at), flight.rate(at),
        strict=True,
    )  # fmt: skip
    return tuple(
        View(camera=taken_by, center=c, rotation=r, velocity=v, rate=w) for c, r, v, w in parts
    )
