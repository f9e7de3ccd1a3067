"""A drone's camera by its name: what its maker states, with wide errors."""

from __future__ import annotations

from uavgram.errors import UavgramError, near_miss
from uavgram.io.cameras.drone_table import drone_cameras
from uavgram.model.camera.assumed_errors import ORDINARY_EQUIVALENTS_MM
from uavgram.model.camera.calibration import Calibration
from uavgram.model.camera.tags import CameraTags, DroneCamera
from uavgram.stages.camera.assume import assume_camera


def camera_of_drone(name: str) -> Calibration:
    """The calibration to assume of a drone's main camera.

    Parameters
    ----------
    name
        Of the drone (``DJI Mavic 2 Pro``) or of its camera (``L1D-20c``), as the table has them.

    Raises
    ------
    UavgramError
        The table does not know it, or holds no focal length of it.
    """
    known = [
        camera
        for camera in drone_cameras()
        if camera.make_model in ORDINARY_EQUIVALENTS_MM and not camera.is_thermal
    ]
    wanted = _key(name)
    named = [one for one in known if wanted == _key(one.make_model)] or [
        one for one in known if wanted and wanted in _key(one.comment)
    ]
    if not named:
        drones = sorted({_drone(one) for one in known})
        hint = near_miss(name, drones)
        raise UavgramError(
            f"the drone {name!r} is not known{f' ({hint})' if hint else ''}: name one of "
            f"{', '.join(drones)}; or calibrate its camera (uavgram calibrate) and name the camera "
            "file (camera: {file: camera.yaml})"
        )
    # The plainest of several, such as a Phantom 4 Pro beside its second version.
    camera = min(named, key=lambda one: len(one.comment))
    tags = CameraTags(
        path=name,
        width_px=camera.width_px,
        height_px=camera.height_px,
        model=camera.make_model,
        focal_35mm_mm=ORDINARY_EQUIVALENTS_MM[camera.make_model],
    )
    return assume_camera(tags, drone_cameras())[0]


def _drone(camera: DroneCamera) -> str:
    """Name of the drone in the table's comment, without remarks."""
    name = camera.comment
    for end in ("/", "(", "Main", "color"):
        name = name.partition(end)[0]
    return name.strip()


def _key(name: str) -> str:
    return "".join(name.split()).casefold()
