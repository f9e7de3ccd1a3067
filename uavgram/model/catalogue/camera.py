"""Messages on the camera of a survey."""

from __future__ import annotations

from uavgram.model.catalogue.entry import NOTE, WARNING, Effect, Entry

CAMERA = (
    Entry(
        "camera-assumed",
        WARNING,
        finding="There is no calibration of this camera. The program uses values for its type.",
        consequence="Their uncertainties are wide, and are included in the results.",
        action="Calibrate the camera with fifteen photos of a chessboard.",
    ),
    Entry(
        "camera-unknown",
        WARNING,
        finding="Nothing is known of this camera. The program assumes an ordinary drone camera.",
        consequence=(
            "Its uncertainties are very wide. It is wrong for a telephoto, zoom or fisheye lens."
        ),
        action="Tape six lengths or more, and calibrate the camera.",
    ),
    Entry(
        "camera-exact",
        WARNING,
        finding="The camera file states no errors, so the camera counts as exactly known.",
        consequence="All uncertainties are too small by the camera's real error.",
        action="Calibrate the camera.",
    ),
    Entry(
        "camera-focal",
        WARNING,
        finding="The focal length has a large uncertainty.",
        consequence=(
            "Without lengths on the ground, every distance has the same relative uncertainty."
        ),
        action="Calibrate the camera, or tape lengths.",
    ),
    Entry(
        "camera-centre",
        WARNING,
        finding="The principal point (where the lens looks in the photo) has a large uncertainty.",
        consequence="It has the effect of a tilt of the camera.",
        action="Calibrate the camera.",
    ),
    Entry(
        "camera-sigma-assumed",
        WARNING,
        finding="The camera file states no errors. The program assumes wide ones.",
        action="If you know better values, write a camera.yaml with `sigma`.",
    ),
    Entry(
        "camera-sigma-from-file",
        NOTE,
        finding="The errors of the camera are those in its file.",
    ),
    Entry(
        "camera-contradicted",
        WARNING,
        finding=(
            "The survey fits only another camera than the calibrated or assumed one: another zoom, "
            "focus or resolution, a cropped photo, or large errors in picks and lengths."
        ),
        action="Check picks and lengths, and calibrate the camera as it was used.",
        effect=Effect.AMBER,
        one="The camera file does not belong to these photos.",
    ),
    Entry(
        "camera-learnt",
        NOTE,
        finding=(
            "States which values of the camera picks and lengths determine better than its file."
        ),
        is_detail=True,
    ),
    Entry(
        "camera-not-learnt",
        NOTE,
        finding="Picks and lengths do not improve the values of the camera.",
        is_detail=True,
    ),
    Entry(
        "lens-rim",
        NOTE,
        finding="At the rim of the image the lens model is not valid.",
        consequence="Picks there are left out.",
        action="Calibrate the camera with the board in the corners of the photos.",
    ),
    Entry(
        "readout-published",
        NOTE,
        finding=(
            "This camera exposes a photo row by row (rolling shutter). The program uses the "
            "readout time of a published table as a first value."
        ),
        action="If you know the camera's own value, state it as `readout_ms` in camera.yaml.",
    ),
    Entry(
        "readout-unused",
        NOTE,
        finding=(
            "This camera exposes a photo row by row (rolling shutter). Without a log and tie "
            "points its motion during that time is unknown, so the effect is not corrected."
        ),
        consequence="The results contain the error that it causes.",
    ),
    Entry(
        "shutter-found",
        NOTE,
        finding=(
            "The survey shows that this camera exposes a photo row by row (rolling shutter), and "
            "in what time. The result takes it into account. Without a log, tie points show how "
            "each photo is bent, but hardly how far the drone moved meanwhile."
        ),
        consequence="Without a log, lengths along the flight have larger sigmas.",
        action=(
            "If you know the camera's own value, state it as `readout_ms` in camera.yaml. With it, "
            "and with photos that have a time (EXIF; see `time:`), the speed is known and these "
            "sigmas are small again."
        ),
    ),
    Entry(
        "readout-left-out",
        NOTE,
        finding=(
            "The picks would need an impossible readout time of the camera, so the effect was left "
            "out: another observation does not fit."
        ),
        action="Check the other warnings. Points off the ground can have this effect.",
    ),
)
