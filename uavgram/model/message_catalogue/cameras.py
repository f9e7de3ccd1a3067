"""Messages on the camera of a survey, and on its calibration."""

from __future__ import annotations

from uavgram.model.message_catalogue.entry import ERROR, NOTE, WARNING, Effect, Entry

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
            "Picks and lengths show some values of the camera better than its file does. The "
            "message names them."
        ),
        consequence="The results use the better values.",
        is_detail=True,
    ),
    Entry(
        "camera-not-learnt",
        NOTE,
        finding="Picks and lengths do not show the values of the camera better than its file.",
        consequence="The results use the values of the file.",
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


CALIBRATION = (
    Entry(
        "calibration-not-converged",
        ERROR,
        finding="The calibration found no stable result.",
        consequence="Do not use this camera file.",
        action="Estimate fewer coefficients, or take more photos with the board tilted.",
    ),
    Entry(
        "photo-without-board",
        WARNING,
        finding="Photos show no board, and are not used.",
        action="Check whether the whole board is in the photo, and whether `--board` is right.",
    ),
    Entry(
        "photo-other-board",
        WARNING,
        finding="A photo shows a board of another size, and is not used.",
        action="Check `--board`.",
    ),
    Entry(
        "photo-unusable",
        WARNING,
        finding="A photo was left out, for the reason in the message.",
        action="Correct that, or take another photo.",
    ),
    Entry(
        "photo-removed",
        WARNING,
        finding="With `--outliers remove`, a photo that does not fit the others was left out.",
        action="Look at the photo. If fewer than 15 are left, take more.",
    ),
    Entry(
        "photo-suspect",
        WARNING,
        finding="A photo does not fit the others.",
        action=(
            "If the board moved, was blurred or was found at the wrong place, leave the photo out "
            "(`--outliers remove`)."
        ),
    ),
    Entry(
        "photos-disagree",
        WARNING,
        finding="Photos differ about the camera more than their noise explains.",
        consequence="The sigmas were widened.",
        action="Use a stiff, flat board, and hold the camera still.",
    ),
    Entry(
        "two-cameras",
        WARNING,
        finding="The photos are, or may be, of two cameras, zooms or focus settings.",
        action="Calibrate each by itself. Otherwise keep focus and zoom fixed.",
    ),
    Entry(
        "zoom-changed",
        WARNING,
        finding="The photos state different focal lengths.",
        action="Calibrate each setting by itself.",
    ),
    Entry(
        "focus-changed",
        WARNING,
        finding="The photos state different focus distances.",
        action="Calibrate each setting by itself.",
    ),
    Entry(
        "focal-length-changes",
        WARNING,
        finding=(
            "The focal length changes from photo to photo, because of autofocus, zoom or "
            "stabilisation."
        ),
        action="Switch them off.",
    ),
    Entry(
        "exif-focal",
        WARNING,
        finding=(
            "The focal length differs from the one that the photos state: they were cropped or "
            "resized, or the proportions of the board are wrong."
        ),
        action="Calibrate with whole photos as the camera writes them.",
    ),
    Entry(
        "rolling-shutter",
        WARNING,
        finding=(
            "The rows of a photo are shifted against each other: the camera or the board moved "
            "during the exposure."
        ),
        action="Hold both still, in good light.",
    ),
    Entry(
        "few-photos",
        WARNING,
        finding="There are few photos.",
        consequence="They determine the camera and its errors poorly.",
        action="Take 15 to 30 photos.",
    ),
    Entry(
        "few-tilts",
        WARNING,
        finding="All photos see the board at the same tilt.",
        consequence="Focal length and distance cannot be separated.",
        action="Tilt the board by 30 to 45 degrees, to all sides.",
    ),
    Entry(
        "one-roll",
        WARNING,
        finding="All photos were taken at the same roll of the camera.",
        action="Take half of them with the camera turned by a quarter turn.",
    ),
    Entry(
        "image-not-covered",
        WARNING,
        finding="Parts of the image contain no corner of the board.",
        consequence="The lens is extrapolated there.",
        action="Take photos with the board in the corners of the image.",
    ),
    Entry(
        "lens-folds",
        WARNING,
        finding="The lens model is not unique at the rim of the image.",
        consequence="That part of the image cannot be used.",
        action="Take photos with the board in the corners, or estimate fewer coefficients.",
    ),
    Entry(
        "pixels-not-square",
        WARNING,
        finding=(
            "The result has oblong pixels, which no sensor has: focal length and tilt are not "
            "separated."
        ),
        action="Set `--fix-aspect`, or turn the camera by a quarter turn for some photos.",
    ),
    Entry(
        "corner-sigma-too-small",
        WARNING,
        finding="Corners fit worse than their stated sigmas.",
        consequence="The sigmas of the camera are too small.",
        action="Use `corner_sigma: residuals`.",
    ),
    Entry(
        "corner-sigma-scaled",
        NOTE,
        finding="The stated errors of the corners were replaced by those that the photos show.",
    ),
    Entry(
        "corner-common-error",
        NOTE,
        finding=(
            "Corners differ from the model by more than their own noise, for example because of "
            "the print of the board."
        ),
        consequence="This error was added to their sigmas.",
    ),
    Entry(
        "corners-misfit",
        WARNING,
        finding="The photos are sharpened, smeared or overexposed.",
        consequence="Corners are known to a few tenths of a pixel only.",
        action="Switch sharpening off, use more light, hold the camera still.",
    ),
    Entry(
        "corners-removed",
        NOTE,
        finding="With `--outliers remove`, corners that do not fit were left out.",
    ),
    Entry(
        "corners-suspect",
        NOTE,
        finding="Corners fit worse than chance allows.",
        action="To leave them out, use `--outliers remove`.",
    ),
    Entry(
        "correlated-parameters",
        NOTE,
        finding="Some parameters of the lens are known only in combination.",
        consequence="Their joint errors are in the file, so the results are right.",
    ),
    Entry(
        "intrinsics-prior",
        NOTE,
        finding="States the previous knowledge of the camera, and the improvement by the photos.",
    ),
    Entry(
        "lens-model",
        NOTE,
        finding="States which lens model was chosen among those that were compared, and why.",
    ),
    Entry(
        "board-partial",
        NOTE,
        finding="A photo shows a part of a chessboard, and it is unknown which part.",
        consequence="For a flat board the result is right.",
        action="If the bow of the board is estimated, leave the photo out.",
    ),
)
