"""Points off the ground in 3-D: rulers from the ground below them, and ellipsoids."""

from __future__ import annotations

from typing import get_args

import numpy as np
import rerun as rr

from uavgram.geometry.motion.rotation import xyzw_from_matrix
from uavgram.imaging.photos.preview import Pixels
from uavgram.model.result.result import Result
from uavgram.model.result.tables import HeightSource
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.view_texts import log_in_space
from uavgram.views.recording.world.labels import height_labels
from uavgram.views.style import HEIGHT_COLOURS
from uavgram.views.survey.off_ground import OffGround, height_of

# Rerun draws at most 60 000 ellipsoids of one entity.
MOST_ELLIPSOIDS = 50_000
RULERS = "survey/points/heights"
ELLIPSOIDS = "survey/points/ellipsoid_95"
SIDE_TEXTS = "from_the_side/heights"
# In points of the screen.
RULER_WIDTH = 2.5


def log_heights(recorder: Recorder, result: Result, scene: Scene, colours: Pixels) -> None:
    """Log rulers, ellipsoids and texts that show heights and their accuracy.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    colours
        (K, 3) colours of all points' ellipses.
    """
    standing = scene.off_ground
    if standing is None or scene.side_eye is None:
        return
    for source in get_args(HeightSource):
        _rulers(recorder, result, standing, source)
    _ellipsoids(recorder, result, standing, "true_size", 1, colours)
    if scene.ellipsoid_factor > 1:
        _ellipsoids(recorder, result, standing, "exaggerated", scene.ellipsoid_factor, colours)
    log_in_space(recorder, SIDE_TEXTS, height_labels(result, scene, scene.side_eye))


def _rulers(recorder: Recorder, result: Result, standing: OffGround, source: HeightSource) -> None:
    """Log the ruler from the ground to each point; its label under the pointer is the height."""
    which = standing.of(source)
    if not len(which):
        return
    points, rows = result.points, standing.rows[which]
    recorder.static(
        f"{RULERS}/{source}",
        rr.LineStrips3D(
            np.stack([standing.foot_m[which], points.position_world_m[rows]], axis=1),
            colors=HEIGHT_COLOURS[source],
            radii=rr.Radius.ui_points(RULER_WIDTH / 2),
            labels=[f"{points.label[row]} {height_of(points, row)}" for row in rows.tolist()],
            show_labels=False,
        ),
    )


def _ellipsoids(
    recorder: Recorder,
    result: Result,
    standing: OffGround,
    size: str,
    factor: int,
    colours: Pixels,
) -> None:
    known = np.flatnonzero(standing.half_axes_m[:, 0] > 0)
    for start in range(0, len(known), MOST_ELLIPSOIDS):
        part = known[start : start + MOST_ELLIPSOIDS]
        rows = standing.rows[part]
        recorder.static(
            f"{ELLIPSOIDS}_{size}/{start // MOST_ELLIPSOIDS}",
            rr.Ellipsoids3D(
                centers=result.points.position_world_m[rows],
                half_sizes=factor * standing.half_axes_m[part],
                quaternions=xyzw_from_matrix(standing.directions[part]),
                colors=colours[rows],
                fill_mode="TransparentFillMajorWireframe",
            ),
        )
