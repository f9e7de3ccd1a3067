"""Conversion between COLMAP's cameras.txt and `Calibration`.

The file and its models: COLMAP documentation, "Output Format" and src/colmap/sensor/models.h.
COLMAP puts the centre of the top-left pixel at (0.5, 0.5), this program at (0, 0).
"""

from __future__ import annotations

from pathlib import Path

from uavgram.errors import InputError
from uavgram.input_files import read_text
from uavgram.io.cameras.choice import assume_errors, choose_camera
from uavgram.model.camera.calibration import Calibration, LensModel
from uavgram.model.message import Message

PIXEL_CENTRE_PX = 0.5

# Parameters of each model, in COLMAP's order; f stands for fx and fy.
_MODELS: dict[str, tuple[LensModel, tuple[str, ...]]] = {
    "SIMPLE_PINHOLE": ("brown", ("f", "cx", "cy")),
    "PINHOLE": ("brown", ("fx", "fy", "cx", "cy")),
    "SIMPLE_RADIAL": ("brown", ("f", "cx", "cy", "k1")),
    "RADIAL": ("brown", ("f", "cx", "cy", "k1", "k2")),
    "OPENCV": ("brown", ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")),
    "FULL_OPENCV": (
        "brown",
        ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    ),
    "SIMPLE_RADIAL_FISHEYE": ("fisheye", ("f", "cx", "cy", "k1")),
    "RADIAL_FISHEYE": ("fisheye", ("f", "cx", "cy", "k1", "k2")),
    "OPENCV_FISHEYE": ("fisheye", ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")),
}
_HEADER = """\
# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
# Number of cameras: 1
"""


def is_colmap_cameras(text: str) -> bool:
    """Return whether a text is a cameras.txt, by its first line of data.

    That line begins with a number and a model in capitals.
    """
    lines = (line.split() for line in text.splitlines() if not line.startswith("#"))
    first = next((fields for fields in lines if fields), [])
    return len(first) > 4 and first[0].isdigit() and first[1].replace("_", "").isupper()


def read_colmap_camera(
    path: str | Path, wanted: str | None = None
) -> tuple[Calibration, tuple[Message, ...]]:
    """Read one camera of a cameras.txt.

    Parameters
    ----------
    path
        The file.
    wanted
        Its CAMERA_ID; not needed where there is only one.

    Raises
    ------
    InputError
        Names the line of a mistake, or the cameras to choose from.
    """
    path = Path(path)
    lines = read_text(path, "name a cameras.txt of COLMAP").splitlines()
    cameras = {
        fields[0]: (number, fields)
        for number, line in enumerate(lines, 1)
        if (fields := line.split()) and not line.startswith("#")
    }
    name, (number, fields) = choose_camera(path, cameras, wanted)
    model, size_px, parameters = _camera(path, number, fields)
    return assume_errors(
        path, name=f"{path.stem} {name}", model=model, size_px=size_px, parameters=parameters
    )


def _camera(
    path: Path, number: int, fields: list[str]
) -> tuple[LensModel, tuple[int, int], list[float]]:
    """Parse lens model, size and parameters of a line into this program's convention."""
    if len(fields) < 5:
        raise InputError(path, "must be CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]", number)
    if fields[1] not in _MODELS:
        raise InputError(
            path,
            f"camera {fields[0]} has the model {fields[1]}, which is none of "
            f"{', '.join(_MODELS)}: run COLMAP with one of these (OPENCV fits most lenses)",
            number,
        )
    model, names = _MODELS[fields[1]]
    try:
        size_px = int(fields[2]), int(fields[3])
        values = [float(field) for field in fields[4:]]
    except ValueError as fault:
        raise InputError(path, f"camera {fields[0]}: {fault}", number) from fault
    if len(values) != len(names):
        raise InputError(
            path,
            f"camera {fields[0]}: {fields[1]} has {len(names)} parameters ({' '.join(names)}), "
            f"got {len(values)}",
            number,
        )
    # Order of this program; the principal point moves by half a pixel.
    by_name = dict(zip(names, values, strict=True))
    f = by_name.get("f", 0.0)
    order = ["k1", "k2", "p1", "p2", "k3"] if model == "brown" else ["k1", "k2", "k3", "k4"]
    if "k6" in names:
        order += ["k4", "k5", "k6"]
    parameters = [by_name.get("fx", f), by_name.get("fy", f)]
    parameters += [by_name[name] - PIXEL_CENTRE_PX for name in ("cx", "cy")]
    return model, size_px, [*parameters, *(by_name.get(name, 0.0) for name in order)]


def colmap_text(calibration: Calibration) -> str:
    """Format a camera as text of a cameras.txt with all digits; COLMAP has no sigmas."""
    fx, fy, cx, cy, *lens = calibration.parameters.tolist()
    values = [fx, fy, cx + PIXEL_CENTRE_PX, cy + PIXEL_CENTRE_PX, *lens]
    if calibration.model == "fisheye":
        model = "OPENCV_FISHEYE"
    elif any(values[8:]):
        model = "FULL_OPENCV"
        values += [0.0] * (12 - len(values))
    else:
        model = "OPENCV"
        values = values[:8]
    size = f"{calibration.width_px} {calibration.height_px}"
    return f"{_HEADER}1 {model} {size} {' '.join(map(repr, values))}\n"
