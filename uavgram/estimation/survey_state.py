"""The unknowns of a survey: where each stands in the vector, their values, and how they move."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.estimation.sparse_factor import Structure
from uavgram.geometry.rotation import exp_so3
from uavgram.geometry.telemetry_pose import SHARED_SIZE
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import Survey

PLANE_SIZE = 3


@dataclass(frozen=True)
class Layout:
    """Order of the unknowns: points, frames, intrinsics, plane, telemetry.

    Attributes
    ----------
    points
        K, each with `point_size` unknowns: east, north and, where the ground is rough, the
        point's own departure from the plane.
    frames
        F, each with six: δcentre in world [m], δθ in camera [rad].
    intrinsics
        Number of unknown combinations of the interior orientation, in sigmas.
    plane
        3 (height, slope east, slope north), or 0 where the plane is the gauge.
    telemetry
        11 (see geometry/telemetry_pose.py), or 0 without a log.
    """

    points: int
    point_size: int
    frames: int
    intrinsics: int
    plane: int
    telemetry: int

    @property
    def first_frame(self) -> int:
        """Column of the first frame's first unknown."""
        return self.points * self.point_size

    @property
    def first_intrinsic(self) -> int:
        """Column of the first unknown of the interior orientation."""
        return self.first_frame + 6 * self.frames

    @property
    def first_plane(self) -> int:
        """Column of the plane's height."""
        return self.first_intrinsic + self.intrinsics

    @property
    def first_telemetry(self) -> int:
        """Column of the first unknown shared by the telemetry."""
        return self.first_plane + self.plane

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.first_telemetry + self.telemetry

    @property
    def structure(self) -> Structure:
        """For the elimination order."""
        return Structure(
            size=self.size,
            points=self.points,
            point_size=self.point_size,
            block_size=6,
            first_shared=self.first_intrinsic,
        )

    def point_columns(self, index: Ints) -> Ints:
        """(n, point_size) unknowns of n points."""
        return index[:, None] * self.point_size + np.arange(self.point_size)

    def frame_columns(self, index: Ints) -> Ints:
        """(n, 6) unknowns of n frames."""
        return self.first_frame + index[:, None] * 6 + np.arange(6)

    def shared_columns(self, first: int, count: int, rows: int) -> Ints:
        """(rows, count) the same shared unknowns in every row."""
        return np.broadcast_to(first + np.arange(count), (rows, count))

    def describe(self, index: int, survey: Survey) -> str:
        """Which unknown stands at `index`, in words."""
        if index < self.first_frame:
            return f"the position of point {survey.label[index // self.point_size]!r}"
        if index < self.first_intrinsic:
            frame = (index - self.first_frame) // 6
            return f"the pose of frame {survey.frame_id[frame]!r}"
        if index < self.first_plane:
            return "the interior orientation"
        return "the ground plane" if index < self.first_telemetry else "the telemetry's biases"


@dataclass(frozen=True, eq=False)
class State:
    """Values of the unknowns.

    Attributes
    ----------
    point
        (K, point_size) east, north [and departure] in metres.
    center, rotation
        (F, 3), (F, 3, 3) world from camera.
    intrinsic
        (I,) departures from the calibration, in sigmas.
    plane
        (3,) height at the pivot [m], slopes.
    telemetry
        (11,) or (0,).
    """

    point: Floats
    center: Floats
    rotation: Floats
    intrinsic: Floats
    plane: Floats
    telemetry: Floats


def layout_of(survey: Survey, intrinsics: int) -> Layout:
    """Which unknowns a survey has."""
    return Layout(
        points=len(survey.label),
        point_size=3 if survey.ground.roughness_sigma_m > 0 else 2,
        frames=len(survey.frame_id),
        intrinsics=intrinsics,
        plane=PLANE_SIZE if survey.gauge == "world" else 0,
        telemetry=SHARED_SIZE if survey.telemetry is not None else 0,
    )


def move(layout: Layout, state: State, step: Floats) -> State:
    """The state after an increment (size,) of the unknowns."""
    frame_step = step[layout.first_frame : layout.first_intrinsic].reshape(-1, 6)
    plane = state.plane
    if layout.plane:
        plane = plane + step[layout.first_plane : layout.first_telemetry]
    return replace(
        state,
        point=state.point + step[: layout.first_frame].reshape(state.point.shape),
        center=state.center + frame_step[:, :3],
        rotation=state.rotation @ exp_so3(frame_step[:, 3:]),
        intrinsic=state.intrinsic + step[layout.first_intrinsic : layout.first_plane],
        plane=plane,
        telemetry=state.telemetry + step[layout.first_telemetry :],
    )
