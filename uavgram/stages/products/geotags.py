"""Convert poses in the local world to geographic tags for other programs."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.geometry.motion.camera_motion import nadir_from_gimbal
from uavgram.geometry.motion.rotation import ENU_FROM_NED, GIMBAL_FROM_CAMERA, ypr_from_matrix
from uavgram.model.arrays import Floats
from uavgram.model.frames import GeoTags, PoseChoice, Poses
from uavgram.model.survey import World


def geotag(
    poses: Poses, path: tuple[str, ...], pose: tuple[PoseChoice, ...], world: World
) -> GeoTags:
    """Convert poses to tags.

    Angles are from the north of the world's origin; true north at a photo differs by the meridian
    convergence, 0.01 degrees per kilometre of easting at 48 degrees of latitude.

    Parameters
    ----------
    poses, path, pose
        (N,) poses, paths of their photos, and kinds of the poses.
    world
        Location of the local world.

    Raises
    ------
    GeometryError
        The world is not tied to the earth.
    """
    if world.origin is None:
        raise GeometryError(
            "nothing ties this survey to the earth (no flight log, no photo poses, no geodetic "
            "control points), so there are no coordinates to write: name one of them in the "
            "project"
        )
    latitude, longitude, height = geodetic_from_enu(poses.center_world_m, world.origin)
    ned_from_gimbal = ENU_FROM_NED @ poses.world_from_camera @ GIMBAL_FROM_CAMERA.T
    gimbal = np.stack(ypr_from_matrix(ned_from_gimbal), axis=1)
    # Largest horizontal variance: the semi-major axis of the standard ellipse.
    horizontal = np.linalg.eigvalsh(poses.covariance[:, :2, :2])[:, -1]
    return GeoTags(
        frame_id=poses.frame_id,
        path=path,
        pose=pose,
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        datum=world.height_datum,
        gimbal_ypr_rad=_full_turn(gimbal),
        nadir_ypr_rad=_full_turn(nadir_from_gimbal(gimbal)),
        sigma_horizontal_m=np.sqrt(horizontal),
        sigma_vertical_m=np.sqrt(poses.covariance[:, 2, 2]),
    )


def _full_turn(ypr_rad: Floats) -> Floats:
    """Reduce the yaw to [0, 2 pi)."""
    return np.column_stack([np.mod(ypr_rad[:, 0], 2 * np.pi), ypr_rad[:, 1:]])
