"""Cameras of other programs: files of OpenCV, COLMAP and OpenDroneMap, and a table of drones.

OpenCV (YAML, JSON, XML) does not define the keys. The supported ones are those of its samples and
tools (calibration.cpp, the camera calibration tutorial of 2.4 and later, interactive-calibration),
of ROS camera_info, and K and D.

COLMAP's cameras.txt and its models: COLMAP documentation, "Output Format" and
src/colmap/sensor/models.h. COLMAP puts the centre of the top-left pixel at (0.5, 0.5), this program
at (0, 0).

OpenDroneMap and OpenSfM write cameras.json and camera_models.json. Lengths are over max(width,
height), from the centre of the image, which is at ((width - 1) / 2, (height - 1) / 2) when pixels
are counted from the centre of the top-left one (OpenSfM, opensfm/features.py,
normalized_image_coordinates; the models: OpenSfM documentation, "Camera Models").

The table of drone cameras is copyright 2025 Theta Informatics LLC, Apache License 2.0; see the
folder `drone_cameras`.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from uavgram.errors import InputError, suggest_spelling
from uavgram.input_files import read_text
from uavgram.io.json_codec import parse_json
from uavgram.model.arrays import Floats
from uavgram.model.camera import (
    CALIBRATION_FILE,
    Calibration,
    DroneCamera,
    LensModel,
    correlation_of,
    make_assumed_covariance,
    parameter_counts,
    parameter_names,
)
from uavgram.model.message import Message

Entry = TypeVar("Entry")


def choose_camera(
    path: Path, cameras: Mapping[str, Entry], wanted: str | None
) -> tuple[str, Entry]:
    """Choose the named camera, or the only one.

    Parameters
    ----------
    path
        File that holds them, for messages.
    cameras
        Entries of the file by camera name.
    wanted
        Name of the camera to choose; None where there is only one.

    Raises
    ------
    InputError
        There are none, or several and none was named, or none of that name.
    """
    names = ", ".join(map(repr, cameras))
    if not cameras:
        raise InputError(path, "holds no camera")
    if wanted is None and len(cameras) == 1:
        return next(iter(cameras.items()))
    if wanted is None:
        first = next(iter(cameras))
        raise InputError(
            path,
            f"holds {len(cameras)} cameras ({names}): make a file of the one you mean, with "
            f"uavgram camera {path.name} --camera {first!r} --to uavgram --output camera.yaml",
        )
    if wanted not in cameras:
        hint = suggest_spelling(wanted, cameras)
        raise InputError(
            path, f"holds no camera {wanted!r}, but {names}" + (f" ({hint})" if hint else "")
        )
    return wanted, cameras[wanted]


def assume_errors(
    path: Path,
    *,
    name: str,
    model: LensModel,
    size_px: tuple[int, int],
    parameters: Sequence[float],
) -> tuple[Calibration, tuple[Message, ...]]:
    """Make a calibration from a file without sigmas: assume wide ones, and add a message.

    Parameters
    ----------
    path
        The file, for messages.
    name
        Name of the camera.
    model
        Lens model, which defines the parameters.
    size_px
        Width and height of the photos.
    parameters
        (P,) fx, fy, cx, cy [px], then the distortion's coefficients.

    Raises
    ------
    InputError
        A number of the file is impossible for a camera.
    """
    if not all(map(math.isfinite, parameters)):
        raise InputError(path, f"camera {name!r}: holds a value that is not finite")
    if min(parameters[:2]) <= 0 or min(size_px) <= 0:
        raise InputError(path, f"camera {name!r}: focal length and size must be greater than 0")
    calibration = Calibration(
        name=name,
        model=model,
        width_px=size_px[0],
        height_px=size_px[1],
        parameters=np.array(parameters),
        covariance=make_assumed_covariance(
            model, np.array(parameters), size_px[0], CALIBRATION_FILE
        ),
    )
    return calibration, (create_assumed_errors_message(path),)


def create_assumed_errors_message(path: Path) -> Message:
    """Create the message that a file states no sigmas, with the assumed ones."""
    text = (
        f"{path.name} states no errors of the calibration, so wide ones are assumed: "
        f"{100 * CALIBRATION_FILE.focal:g} % of the focal length, "
        f"{100 * CALIBRATION_FILE.centre:g} % of the width for the principal point. Write a "
        "camera.yaml with 'sigma' if you know better."
    )
    return Message("warning", "camera-sigma-assumed", text)


_DRONE_DISTORTION = ("radialR1", "radialR2", "tangentialT1", "tangentialT2", "radialR3")


@cache
def read_drone_cameras() -> tuple[DroneCamera, ...]:
    """Read all cameras of the table."""
    text = files("uavgram.io").joinpath("drone_cameras/droneModels.json").read_text("utf-8")
    return tuple(_read_drone_camera(entry) for entry in json.loads(text)["droneCCDParams"])


def _read_drone_camera(entry: dict[str, Any]) -> DroneCamera:
    pitch = tuple(_quotient(entry[f"ccd{side}MMPerPixel"]) for side in ("Width", "Height"))
    return DroneCamera(
        make_model=entry["makeModel"],
        comment=entry["comment"].split(",")[0],
        is_thermal=entry["isThermal"],
        width_px=entry["widthPixels"],
        height_px=entry["heightPixels"],
        pitch_mm=(pitch[0], pitch[1]),
        focal_mm=float(entry.get("focalLength", math.nan)),
        is_perspective=entry["lensType"] == "perspective",
        distortion=np.array([entry.get(key, 0.0) for key in _DRONE_DISTORTION]),
    )


def _quotient(text: str) -> float:
    """Parse ``6.32692/4000.0``, millimetres over pixels; some have Java's suffix, ``7.68d``."""
    over, _, under = text.partition("/")
    return float(over.rstrip("d")) / float(under.rstrip("d"))


# Keys in lower case without underscores, in order of preference.
_MATRIX = ("cameramatrix", "intrinsicmatrix", "k", "mtx")
_DISTORTION_KEYS = ("distortioncoefficients", "distcoeffs", "d", "dist")
_SIZES = (("imagewidth", "imageheight"), ("width", "height"), ("xresolution", "yresolution"))
_SIZE_PAIRS = ("cameraresolution", "imagesize", "resolution")
_SIGMAS = ("stddeviationintrinsics", "stddeviationsintrinsics")
_COVARIANCE = ("intrinsicscovariance",)
_ROUNDING = 1e-6  # tolerance of symmetry and definiteness, as correlations
_FISHEYE_NAMES = {"fisheye", "equidistant"}
_CALIB_FIX_ASPECT_RATIO = 2  # bit of the key `flags`, opencv2/calib3d.hpp

_XML_ROOT = "<opencv_storage"
_YAML_HEADER = "%YAML:1.0\n---\n"

_MAX_DEPTH = 50
"""Largest number of nested levels in a file that is read; OpenCV writes 4.

OpenCV's recursive parser ends the whole program where nesting takes too much memory.
"""
_LEVEL = r"(?P<opened>[\[{]|<(?=[^/?!\s]))|(?P<closed>[\]}]|</|/>)"
_ASIDE = (
    r"(?P<aside>\"(?:[^\"\\\n]|\\.)*\"|'[^'\n]*'|<!--.*?(?:-->|\Z)|/\*.*?(?:\*/|\Z)"
    r"|(?:\#|//)[^\n]*)"
)  # quotes and comments
_YAML_LEVEL = re.compile(r"[-:](?![0-9.])")  # each may begin one more block, even in the same line


def is_opencv_calibration(path: str | Path) -> bool:
    """Return whether a file is OpenCV's, not this program's camera.yaml, by its header and keys."""
    try:
        text = Path(path).read_text(encoding="utf-8-sig", errors="replace").lstrip()
    except OSError:
        return False  # the reader raises the error
    if text.startswith("<"):
        return _XML_ROOT in text
    if text.startswith("%YAML"):
        return True
    names = r"camera_?matrix|intrinsic_?matrix|k|mtx"
    return (
        re.search(rf"^[{{,\s]*[\"']?({names})[\"']?\s*:", text, re.IGNORECASE | re.MULTILINE)
        is not None
    )


def read_opencv_calibration(path: str | Path) -> tuple[Calibration, tuple[Message, ...]]:
    """Read a calibration file that OpenCV wrote, or one with the same content.

    Returns
    -------
    calibration
        Its covariance is built from the file's standard deviations where it has them, else from
        wide defaults.
    messages
        Origin of the covariance.

    Raises
    ------
    InputError
        The file cannot be read, holds no camera matrix, distortion or image size, or a lens model
        that this program does not know.
    """
    path = Path(path)
    keys = _read_keys(path)
    model, parameters = _parameters(path, keys)
    width_px, height_px = _image_size(path, keys)
    covariance, message = _errors(path, keys, model, parameters, width_px)
    calibration = Calibration(
        name=str(keys.get("cameraname") or path.stem),
        model=model,
        width_px=width_px,
        height_px=height_px,
        parameters=parameters,
        covariance=covariance,
    )
    return calibration, (message,)


def _read_keys(path: Path) -> dict[str, Any]:
    """Read all top-level keys of the file, in lower case without underscores."""
    text = read_text(path, "so it is no camera calibration")
    if text.lstrip().startswith("<") and _XML_ROOT not in text:
        raise InputError(
            path,
            "is XML of another program, no camera calibration: name a camera.yaml, or a file that "
            "OpenCV wrote",
        )
    if (deep := _find_too_deep(text)) is not None:
        raise InputError(
            path,
            f"has more than {_MAX_DEPTH} levels of brackets, tags or keys inside each other: it is "
            "damaged, or no calibration; export the calibration again",
            deep,
        )
    is_bare_yaml = not text.lstrip().startswith(("%YAML", "<", "{"))
    content = _YAML_HEADER + text if is_bare_yaml else text
    try:
        storage = cv2.FileStorage(content, cv2.FileStorage_READ | cv2.FileStorage_MEMORY)
    except (cv2.error, SystemError) as fault:  # the binding wraps the parser's error in the latter
        # The error text is about OpenCV's own source; only the line number in the file is useful.
        at = re.search(r"\(([0-9]+)\):", str(fault.__cause__ or fault))
        line = int(at[1]) - (_YAML_HEADER.count("\n") if is_bare_yaml else 0) if at else None
        raise InputError(
            path,
            "cannot be read as a calibration file of OpenCV (YAML, JSON or XML): it is damaged or "
            "cut off here; export the calibration again",
            line if line and line > 0 else None,
        ) from fault
    root = storage.root()
    if not root.isMap():
        raise InputError(path, "holds no keys, so no camera calibration")
    return {
        key.lower().replace("_", ""): _plain(root.getNode(key))
        for key in root.keys()  # noqa: SIM118
    }


def _find_too_deep(text: str) -> int | None:
    """Find the line from which a parser may nest more than `_MAX_DEPTH` levels; None: it cannot.

    The three formats have quotes and comments in different places. So text that looks like a quote
    or comment may open levels here, but closes only its own.
    """
    is_yaml = not text.lstrip().startswith(("{", "<"))
    if is_yaml:  # no quote goes over several lines: such a line is a comment in any case
        text = re.sub(r"^[ \t]*#[^\r\n\0]*", "", text, flags=re.MULTILINE)
    depth = 0
    for found in re.finditer(f"{_ASIDE}|{_LEVEL}", text, re.DOTALL):
        least = depth if found["aside"] else 0
        for one in re.finditer(_LEVEL, found[0]) if found["aside"] else [found]:
            depth = depth + 1 if one["opened"] else max(depth - 1, least)
            if depth > _MAX_DEPTH:
                return text.count("\n", 0, found.start()) + 1
    if not is_yaml:
        return None
    at_indent: dict[int, int] = {}  # largest number of blocks that a line begins
    for number, line in enumerate(text.splitlines(), 1):
        content = line.lstrip()
        blocks = len(_YAML_LEVEL.findall(content))
        indent = len(line) - len(content)
        at_indent[indent] = max(blocks, at_indent.get(indent, 0))
        if sum(at_indent.values()) > _MAX_DEPTH:
            return number
    return None


def _plain(node: cv2.FileNode) -> Any:  # noqa: ANN401
    """Convert a node to plain data: numbers, text, lists, mappings.

    A matrix becomes a mapping of its rows, cols and data.
    """
    if node.isMap():
        return {key: _plain(node.getNode(key)) for key in node.keys()}  # noqa: SIM118
    if node.isSeq():
        return [_plain(node.at(i)) for i in range(node.size())]
    if node.isString():
        return node.string()
    return node.real() if node.isReal() or node.isInt() else None


def _numbers(path: Path, keys: Mapping[str, Any], names: tuple[str, ...]) -> Floats | None:
    """Return flat numbers of the first of these keys that the file has; None where it has none."""
    name = next((name for name in names if name in keys), None)
    if name is None:
        return None
    value = keys[name]
    data = value.get("data") if isinstance(value, dict) else value
    try:
        numbers: Floats = np.array(data, dtype=np.float64).ravel()
    except (TypeError, ValueError) as fault:
        raise InputError(path, f"{name}: is no matrix of numbers") from fault
    if not np.isfinite(numbers).all():
        raise InputError(path, f"{name}: holds a value that is not finite")
    return numbers


def _image_size(path: Path, keys: Mapping[str, Any]) -> tuple[int, int]:
    sizes = [[keys.get(name) for name in names] for names in _SIZES if keys.keys() >= set(names)]
    pair = _numbers(path, {"size": sizes[0]} if sizes else keys, ("size", *_SIZE_PAIRS))
    if pair is None or len(pair) != 2:
        raise InputError(
            path,
            "states no image size, without which its pixels mean nothing: add the keys "
            "image_width and image_height",
        )
    if pair.min() < 1 or (pair % 1 != 0).any():
        raise InputError(path, f"the image size must be whole pixels (got {pair.tolist()})")
    return int(pair[0]), int(pair[1])


def _parameters(path: Path, keys: Mapping[str, Any]) -> tuple[LensModel, Floats]:
    """Read the lens model and its (P,) parameters in this program's order."""
    matrix = _numbers(path, keys, _MATRIX)
    if matrix is None:
        stereo = " (a file of two cameras? write one for each)" if "m1" in keys else ""
        raise InputError(path, f"holds no camera_matrix{stereo}")
    if len(matrix) != 9:
        raise InputError(path, f"camera_matrix: must be 3 x 3 (got {len(matrix)} numbers)")
    fx, skew, cx, zero, fy, cy = matrix[:6]
    if min(fx, fy) <= 0:
        raise InputError(path, f"camera_matrix: fx and fy must be positive (got {fx:g}, {fy:g})")
    if abs(skew) > 1e-6 * fx or zero != 0 or matrix[6:].tolist() != [0.0, 0.0, 1.0]:
        raise InputError(path, "camera_matrix: must be [fx 0 cx; 0 fy cy; 0 0 1], without skew")
    given = _numbers(path, keys, _DISTORTION_KEYS)
    if given is None:
        raise InputError(path, "holds no distortion_coefficients: add them (0 where there is none)")
    model = _lens_model(keys)
    counts = [count - 4 for count in parameter_counts(model)]
    # Trailing zeros may be coefficients of a larger model; drop them unless a covariance has them.
    used = given if any(name in keys for name in _COVARIANCE) else np.trim_zeros(given, "b")
    fits = len(given) == 4 if model == "fisheye" else len(given) >= 4
    if not fits or len(used) > counts[-1]:
        names = " ".join(parameter_names(model, counts[-1] + 4)[4:])
        raise InputError(
            path,
            f"distortion_coefficients: the {model} model has {' or '.join(map(str, counts))} "
            f"({names}), the file {len(given)}: calibrate again without the thin prism and tilted "
            "models",
        )
    coefficients = np.zeros(next(count for count in counts if count >= len(used)))
    coefficients[: len(used)] = used
    return model, np.array([fx, fy, cx, cy, *coefficients])


def _lens_model(keys: Mapping[str, Any]) -> LensModel:
    named = str(keys.get("distortionmodel", keys.get("model", ""))).lower()
    flag = keys.get("fisheyemodel", keys.get("fisheye", 0))
    is_flagged = flag not in {0, None, "", "0", "false"}
    return "fisheye" if is_flagged or named in _FISHEYE_NAMES else "brown"


def _read_sigmas(path: Path, keys: Mapping[str, Any], count: int) -> Floats | None:
    """Read (P,) standard deviations in the order of the parameters; None where there are none."""
    sigma = _numbers(path, keys, _SIGMAS)
    if sigma is None:  # interactive-calibration writes them in two parts
        focal = _numbers(path, keys, tuple(f"{name}stddev" for name in _MATRIX))
        distortion = _numbers(path, keys, tuple(f"{name}stddev" for name in _DISTORTION_KEYS))
        if focal is None or distortion is None:
            return None
        sigma = np.concatenate([focal, distortion])
    if len(sigma) < count or (sigma < 0).any():
        raise InputError(
            path, f"standard deviations: must be {count} numbers, none negative (got {len(sigma)})"
        )
    return sigma[:count]  # calibrateCameraExtended: fx fy cx cy k1 k2 p1 p2 k3, then k4 and on


def _errors(
    path: Path, keys: Mapping[str, Any], model: LensModel, parameters: Floats, width_px: int
) -> tuple[Floats, Message]:
    """Determine the (P, P) covariance, and the message about its origin."""
    count = len(parameters)
    full = _numbers(path, keys, _COVARIANCE)
    sigma = _read_sigmas(path, keys, count)
    if full is not None:
        covariance, what = _full_covariance(path, full, count), "covariance"
    elif sigma is not None:
        covariance, what = _covariance(sigma, parameters, keys), "standard deviations"
    else:
        covariance = make_assumed_covariance(model, parameters, width_px, CALIBRATION_FILE)
        return covariance, create_assumed_errors_message(path)
    text = f"The errors of the calibration are the {what} in {path.name}."
    return covariance, Message("info", "camera-sigma-from-file", text)


def _full_covariance(path: Path, numbers: Floats, count: int) -> Floats:
    """Check the (P, P) covariance of a file that this program wrote, as it may have been edited."""
    if len(numbers) != count**2:
        raise InputError(
            path, f"{_COVARIANCE[0]}: must be {count} x {count} (got {len(numbers)} numbers)"
        )
    matrix = numbers.reshape(count, count)
    correlation = correlation_of(matrix)
    lopsided = np.abs(correlation - correlation.T).max()
    if lopsided > _ROUNDING or np.linalg.eigvalsh(correlation)[0] < -_ROUNDING:
        raise InputError(
            path,
            f"{_COVARIANCE[0]}: is no covariance (not symmetric and positive semidefinite): leave "
            "it out, and give std_deviation_intrinsics",
        )
    return (matrix + matrix.T) / 2


def _covariance(sigma: Floats, parameters: Floats, keys: Mapping[str, Any]) -> Floats:
    """Build the (P, P) covariance from sigmas.

    With a fixed aspect ratio fx depends on fy, and OpenCV writes 0 for the sigma of fx.
    """
    covariance = np.diag(sigma**2)
    flags = keys.get("flags", 0)
    is_tied = isinstance(flags, int | float) and int(flags) & _CALIB_FIX_ASPECT_RATIO
    if is_tied and sigma[0] == 0:
        ratio = parameters[0] / parameters[1]
        covariance[0, 0] = (ratio * sigma[1]) ** 2
        covariance[0, 1] = covariance[1, 0] = ratio * sigma[1] ** 2
    return covariance


def opencv_text(calibration: Calibration, created_utc: str) -> str:
    """Format a calibration as a file in OpenCV's YAML, with all digits.

    The keys are those of OpenCV's samples (calibration.cpp); std_deviation_intrinsics in the order
    of calibrateCameraExtended. ``intrinsics_covariance`` is this program's own addition, which
    others ignore.
    """
    fx, fy, cx, cy = calibration.parameters[:4].tolist()
    storage = cv2.FileStorage(
        "calibration.yml",
        cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY | cv2.FileStorage_FORMAT_YAML,
    )
    storage.write("calibration_time", created_utc)
    storage.write("camera_name", calibration.name)
    storage.write("image_width", calibration.width_px)
    storage.write("image_height", calibration.height_px)
    storage.write("fisheye_model", int(calibration.model == "fisheye"))
    storage.write("camera_matrix", np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]))
    storage.write("distortion_coefficients", calibration.parameters[4:, None].copy())
    sigma = np.sqrt(calibration.covariance.diagonal())
    storage.write("std_deviation_intrinsics", sigma[:, None])
    storage.write("intrinsics_covariance", calibration.covariance.copy())
    return storage.releaseAndGetString()


PIXEL_CENTRE_PX = 0.5

# Parameters of each model, in COLMAP's order; f stands for fx and fy.
_COLMAP_MODELS: dict[str, tuple[LensModel, tuple[str, ...]]] = {
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
    model, size_px, parameters = _read_colmap_row(path, number, fields)
    return assume_errors(
        path, name=f"{path.stem} {name}", model=model, size_px=size_px, parameters=parameters
    )


def _read_colmap_row(
    path: Path, number: int, fields: list[str]
) -> tuple[LensModel, tuple[int, int], list[float]]:
    """Parse lens model, size and parameters of a line into this program's convention."""
    if len(fields) < 5:
        raise InputError(path, "must be CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]", number)
    if fields[1] not in _COLMAP_MODELS:
        raise InputError(
            path,
            f"camera {fields[0]} has the model {fields[1]}, which is none of "
            f"{', '.join(_COLMAP_MODELS)}: run COLMAP with one of these (OPENCV fits most lenses)",
            number,
        )
    model, names = _COLMAP_MODELS[fields[1]]
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


_BROWN = ("k1", "k2", "p1", "p2", "k3")
_FISHEYE = ("k1", "k2", "k3", "k4")
# Lens model and coefficients of each of OpenSfM's models.
_ODM_MODELS: dict[str, tuple[LensModel, tuple[str, ...]]] = {
    "perspective": ("brown", ("k1", "k2")),
    "simple_radial": ("brown", ("k1",)),
    "radial": ("brown", ("k1", "k2")),
    "brown": ("brown", _BROWN),
    "fisheye": ("fisheye", ("k1", "k2")),
    "fisheye_opencv": ("fisheye", _FISHEYE),
}


def is_odm_cameras(text: str) -> bool:
    """Return whether a text is such a file and not OpenCV's JSON: every camera has a projection."""
    return text.lstrip().startswith("{") and '"projection_type"' in text


def read_odm_camera(
    path: str | Path, wanted: str | None = None
) -> tuple[Calibration, tuple[Message, ...]]:
    """Read one camera of a cameras.json.

    Parameters
    ----------
    path
        The file.
    wanted
        The camera's name there; not needed where there is only one.

    Raises
    ------
    InputError
        Describes a missing or unknown entry, or names the cameras to choose from.
    """
    path = Path(path)
    try:
        cameras = parse_json(path, read_text(path, "name a cameras.json of OpenDroneMap"))
    except json.JSONDecodeError as fault:
        raise InputError(path, f"is no JSON: {fault.msg}", fault.lineno) from fault
    if not isinstance(cameras, dict) or not all(isinstance(c, dict) for c in cameras.values()):
        raise InputError(path, "must be an object of cameras by name")
    name, camera = choose_camera(path, cameras, wanted)
    return assume_errors(path, name=name, **_read_odm_lens(path, name, camera))


def _read_odm_lens(path: Path, name: str, camera: dict[str, Any]) -> dict[str, Any]:
    """Parse lens model, size and parameters into this program's convention."""
    kind = camera.get("projection_type")
    if kind not in _ODM_MODELS:
        raise InputError(
            path,
            f"camera {name!r} has the projection {kind!r}, which is none of "
            f"{', '.join(_ODM_MODELS)}: run OpenDroneMap with --camera-lens brown",
        )
    model, coefficients = _ODM_MODELS[kind]

    def number(*keys: str, otherwise: float | None = None) -> float:
        value = next((camera[key] for key in keys if key in camera), otherwise)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(path, f"camera {name!r}: {keys[0]} must be a number (got {value!r})")
        if not math.isfinite(value):
            raise InputError(path, f"camera {name!r}: {keys[0]} is no finite number")
        return float(value)

    width, height = number("width"), number("height")
    if width % 1 or height % 1:
        raise InputError(path, f"camera {name!r}: its size must be whole pixels")
    # Lengths are in units of the longer side, from the centre of the image.
    size = max(width, height)
    focal = number("focal_x", "focal")
    focal_y = number("focal_y", "focal", otherwise=focal)
    parameters = [
        size * focal,
        size * focal_y,
        (width - 1) / 2 + size * number("c_x", otherwise=0.0),
        (height - 1) / 2 + size * number("c_y", otherwise=0.0),
        *(
            number(key) if key in coefficients else 0.0
            for key in (_BROWN if model == "brown" else _FISHEYE)
        ),
    ]
    return {"model": model, "size_px": (int(width), int(height)), "parameters": parameters}
