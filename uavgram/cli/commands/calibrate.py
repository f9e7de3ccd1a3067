"""Command `uavgram calibrate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, Decimal, Flag, app
from uavgram.cli.terminal import print_lines, print_written_files, progress
from uavgram.errors import InputError

Model = Literal["brown", "fisheye"]
Coefficients = Literal["auto", "3", "4", "5", "8"]
Share = Annotated[Decimal, Parameter(validator=validators.Number(gt=0, lt=1))]


@app.command
def calibrate(  # noqa: PLR0913  (one for each option)
    images: Annotated[tuple[str, ...], Parameter(negative=())],
    /,
    *,
    board: str,
    output: Path | None = None,
    name: str | None = None,
    model: Model = "brown",
    coefficients: Coefficients = "auto",
    fix_aspect: Flag = False,
    fix_principal_point: Flag = False,
    bow: Literal["flat", "bowl", "paraboloid"] = "flat",
    prior: Literal["none", "exif"] = "none",
    outliers: Literal["report", "remove"] = "report",
    significance: Share = 0.001,
) -> int:
    """Calibrate a camera from photos of a board: camera.yaml with its covariance, and a report.

    Parameters
    ----------
    images
        Photos of the board, or patterns of their names: 15 to 30, the board tilted to all sides,
        half of them with the camera rolled by a quarter turn, in all corners of the image.
    board
        chessboard:9x6:25mm (inner corners; side of a square) or charuco:8x6:30mm:22mm:DICT_5X5_100
        (squares; sides of a square and of a marker; dictionary).
    output
        Folder of the results; by default `calibration`.
    name
        Name of the camera; by default the one in EXIF.
    model
        Lens model.
    coefficients
        Distortion coefficients: 3 (k1 k2 k3), 5 (and p1 p2) or 8 (rational); fisheye has 4. auto:
        the fewest that predict photos left out.
    fix_aspect
        Pixels are square: fx = fy.
    fix_principal_point
        Fix it in the middle of the image.
    bow
        Estimate the shape of a board that is not flat.
    prior
        exif: focal length and principal point by EXIF and the table of drone cameras take part.
    outliers
        Report corners and photos that do not fit, or remove them one at a time.
    significance
        Probability of a false suspicion in photos without outliers.
    """
    from uavgram.model.board import CalibrationOptions
    from uavgram.pipeline.cameras.calibrate import FOLDER
    from uavgram.pipeline.cameras.calibrate import calibrate as make
    from uavgram.views.calibration.text import calibration_lines

    options = CalibrationOptions(
        model=model,
        coefficients=_count(model, coefficients),
        aspect=1.0 if fix_aspect else None,
        fixed_principal_point=fix_principal_point,
        bow=bow,
        outliers=outliers,
        significance=significance,
    )
    folder = Path(FOLDER) if output is None else output
    done = make(images, board, folder, options, prior=prior, name=name, progress=progress())
    print_lines(*calibration_lines(done.account))
    print_written_files(done.folder, done.files)
    return DONE


def _count(model: Model, coefficients: Coefficients) -> int:
    """Return the number of distortion coefficients, 0 for automatic; check it for the model."""
    if coefficients == "auto":
        return 0
    count = int(coefficients)
    allowed = (3, 5, 8) if model == "brown" else (4,)
    if count not in allowed:
        words = " or ".join(map(str, allowed))
        raise InputError("--coefficients", f"a {model} lens has {words} of them, not {count}")
    return count
