"""Writer of the review of a result: one call, one complete file."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable

import rerun.blueprint as rrb

from uavgram.imaging.photos.preview import Preview
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.result.result import Result
from uavgram.model.result.tables import TieCloud
from uavgram.views.recording.blueprint import blueprint, layout
from uavgram.views.recording.curves import (
    frame_curves,
    list_plots,
    log_plots,
    log_status,
    pose_curves,
)
from uavgram.views.recording.legend import log_legend
from uavgram.views.recording.pages import log_documents
from uavgram.views.recording.photo import (
    PHOTO,
    log_camera,
    log_overlay,
    log_photos,
    log_sightings,
    project_picks,
)
from uavgram.views.recording.points import log_close_up, log_tie_points
from uavgram.views.recording.scene import measure_scene
from uavgram.views.recording.stream import Recorder, open_recording
from uavgram.views.recording.survey import (
    log_footprints,
    log_map,
    log_origin,
    log_profiles,
    log_survey,
)


def write_recording(
    result: Result,
    photos: Iterable[tuple[str, Preview]],
    texture: Callable[[], GroundTexture | None],
    path: str | os.PathLike[str],
    ties: TieCloud | None = None,
) -> None:
    """Write a Rerun recording with its blueprint inside.

    Photos are written as they come, and not kept in memory.

    Parameters
    ----------
    result
        The result to show.
    photos
        Frame names and reduced photos, in any order; a frame without one shows only its overlay.
    texture
        Function that returns the top view of the ground, or None; called after all photos.
    path
        The .rrd file; replaced only once the new one is complete.
    ties
        Tie points, if there are any.

    Raises
    ------
    OutputError
        If the file cannot be written.
    OSError
        If the disk is full.
    """
    made = result.provenance
    identity = (result.name, made.program, made.version, made.inputs, made.options)
    with open_recording(path, identity, result.name, result.frames.time_utc_s) as recorder:
        _log_everything(recorder, result, photos, texture, ties)


def _log_everything(
    recorder: Recorder,
    result: Result,
    photos: Iterable[tuple[str, Preview]],
    texture: Callable[[], GroundTexture | None],
    ties: TieCloud | None,
) -> None:
    # A viewer plays what arrives before the first layout, and then stops at a later photo.
    recorder.stream.send_blueprint(layout(rrb.Tabs()))
    brightened = log_photos(recorder, result, photos)
    ground = texture()
    scene, picks = measure_scene(result, ground), project_picks(result)
    curves, poses = frame_curves(result, picks), pose_curves(result)
    log_origin(recorder, result)
    log_survey(recorder, result, scene, ground)
    log_close_up(recorder, result, scene)
    is_brighter = ground is not None and not ground.tone.is_identity
    log_legend(recorder, result, scene, brightened=is_brighter)
    log_camera(recorder, result, scene)
    log_overlay(recorder, result, scene, picks, PHOTO, brightened)
    if ties is not None:
        log_sightings(recorder, result, ties, PHOTO)
        log_tie_points(recorder, ties)
    log_footprints(recorder, result)
    log_plots(recorder, list_plots(result, curves, poses))
    log_status(recorder, result)
    log_documents(recorder, result, scene, picks, curves, poses)
    log_map(recorder, result)
    log_profiles(recorder, result)
    recorder.stream.send_blueprint(blueprint(result, scene, curves, poses))
