"""An account of a calibration of a simulated camera, with its photos as blank pictures."""

from __future__ import annotations

from typing import Any

import board_scenes
import numpy as np

from uavgram.imaging.photos.preview import Preview, make_preview
from uavgram.model.board import BoardObservations, CalibrationAccount, CalibrationOptions
from uavgram.model.camera import CameraProvenance, LensModel
from uavgram.model.message import Message
from uavgram.model.provenance import InputDigest
from uavgram.stages.calibrate.assessment import describe_lens_effects
from uavgram.stages.calibrate.calibration import calibrate


def make_account(
    seed: int = 0,
    *,
    options: CalibrationOptions | None = None,
    name: str = "a camera",
    spoil: int = 0,
    model: LensModel = "brown",
    **scene: Any,  # noqa: ANN401 - what `make_scene` takes
) -> CalibrationAccount:
    """`spoil` corners of the second photo are 5 px off."""
    if model == "fisheye":
        scene = {"parameters": board_scenes.FISHEYE, "model": model, "distance": (4, 9)} | scene
    made = board_scenes.make_scene(seed, **scene)
    photos = list(made.observations.photos)
    if spoil:
        pixel = photos[1].pixel_px.copy()
        pixel[:spoil] += 5.0
        photos[1] = board_scenes.replace_pixels(photos[1], pixel)
    observations = BoardObservations(board=made.observations.board, photos=tuple(photos))
    options = options or CalibrationOptions(model=model, coefficients=4 if model != "brown" else 5)
    result = calibrate(observations, options, name)
    provenance = CameraProvenance(
        program="uavgram",
        version="1",
        created_utc="2026-01-05T11:00:00+00:00",
        source="calibrated",
        inputs=tuple(
            InputDigest(path=photo.file, sha256=f"{k:064x}", size_bytes=10 + k)
            for k, photo in enumerate(photos)
        ),
        board="chessboard:9x6:1m",
        options={"model": model},
        make="DJI",
    )
    return CalibrationAccount(
        result=result,
        provenance=provenance,
        packages=(("numpy", "2"),),
        without_board=(("wall.jpg", "no board was found"),),
        common_error_px=0.0,
        effects=describe_lens_effects(result),
        messages=(Message("warning", "photo-without-board", "wall.jpg"), *result.messages),
    )


def make_previews(account: CalibrationAccount) -> dict[str, Preview]:
    """A blank picture for every photo."""
    size = (account.result.calibration.height_px, account.result.calibration.width_px)
    blank = make_preview(np.full(size, 90, np.uint8), 320)
    return dict.fromkeys((*account.result.photos.file, "wall.jpg"), blank)
