"""A drone's camera by its name: what its maker states, with wide errors."""

from __future__ import annotations

from uavgram.io.cameras.drone_table import drone_cameras
from uavgram.model.camera.assumed_errors import ORDINARY_EQUIVALENTS_MM
from uavgram.model.camera.calibration import Calibration
from uavgram.model.camera.tags import CameraTags
from uavgram.stages.camera.assume import assume_camera


def camera_of_drone(name: str) -> Calibration | None:
    """The calibration to assume of a drone's main camera; None where nobody knows it.

    Parameters
    ----------
    name
        Of the drone (``DJI Mavic 2 Pro``) or of its camera (``L1D-20c``), as the table has them.
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
        return None
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


def _key(name: str) -> str:
    return "".join(name.split()).casefold()
