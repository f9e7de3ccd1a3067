"""Writer of the review of a calibration: one call, one complete file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from uavgram.errors import OutputError
from uavgram.imaging.photos.preview import Preview
from uavgram.model.camera.calibration_result import CalibrationAccount
from uavgram.views.calibration.recording.blueprint import calibration_blueprint
from uavgram.views.calibration.recording.documents import log_calibration_documents
from uavgram.views.calibration.recording.image_maps import log_image_maps
from uavgram.views.calibration.recording.photos import log_board_photos
from uavgram.views.calibration.recording.plots import log_photo_plots
from uavgram.views.calibration.recording.space import log_space, measure_room
from uavgram.views.recording.stream import open_recording


def write_calibration_recording(
    account: CalibrationAccount, previews: Mapping[str, Preview], path: Path
) -> None:
    """Write a Rerun recording with its blueprint inside.

    Parameters
    ----------
    account
        The calibration to show.
    previews
        Reduced photos by name.
    path
        The .rrd file.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    result = account.result
    room = measure_room(result)
    made = account.provenance
    options = sorted(made.options.items())
    identity = (made.program, made.version, made.inputs, made.board, options)
    times = np.full(len(result.photos.file), np.nan)  # numbered photos: no times
    try:
        path.touch()  # Rerun's own error for a missing folder is no OSError
        with open_recording(path, identity, result.calibration.name, times) as recorder:
            log_space(recorder, result, room)
            log_board_photos(recorder, result, room, previews)
            log_image_maps(recorder, result)
            log_photo_plots(recorder, result)
            log_calibration_documents(recorder, account)
            recorder.stream.send_blueprint(calibration_blueprint(account, room))
    except OSError as error:
        raise OutputError(f"{path}: the recording cannot be written: {error}") from error
