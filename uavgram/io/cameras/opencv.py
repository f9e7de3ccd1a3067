"""Reading and writing of OpenCV's calibration files (YAML, JSON, XML).

OpenCV does not define the keys. The supported ones are those of its samples and tools
(calibration.cpp, the camera calibration tutorial of 2.4 and later, interactive-calibration), of ROS
camera_info, and K and D.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from uavgram.errors import InputError
from uavgram.input_files import read_text
from uavgram.io.cameras.choice import create_assumed_errors_message
from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration import (
    CALIBRATION_FILE,
    Calibration,
    LensModel,
    assumed_covariance,
    correlation_of,
    parameter_counts,
    parameter_names,
)
from uavgram.model.message import Message

# Keys in lower case without underscores, in order of preference.
_MATRIX = ("cameramatrix", "intrinsicmatrix", "k", "mtx")
_DISTORTION = ("distortioncoefficients", "distcoeffs", "d", "dist")
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
    depth = 0
    for found in re.finditer(f"{_ASIDE}|{_LEVEL}", text, re.DOTALL):
        least = depth if found["aside"] else 0
        for one in re.finditer(_LEVEL, found[0]) if found["aside"] else [found]:
            depth = depth + 1 if one["opened"] else max(depth - 1, least)
            if depth > _MAX_DEPTH:
                return text.count("\n", 0, found.start()) + 1
    if text.lstrip().startswith(("{", "<")):
        return None
    at_indent: dict[int, int] = {}  # largest number of blocks that a line begins
    for number, line in enumerate(text.splitlines(), 1):
        content = line.lstrip()
        blocks = 0 if content.startswith("#") else len(_YAML_LEVEL.findall(content))
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
    given = _numbers(path, keys, _DISTORTION)
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


def _stated_sigma(path: Path, keys: Mapping[str, Any], count: int) -> Floats | None:
    """Read (P,) standard deviations in the order of the parameters; None where there are none."""
    sigma = _numbers(path, keys, _SIGMAS)
    if sigma is None:  # interactive-calibration writes them in two parts
        focal = _numbers(path, keys, tuple(f"{name}stddev" for name in _MATRIX))
        distortion = _numbers(path, keys, tuple(f"{name}stddev" for name in _DISTORTION))
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
    sigma = _stated_sigma(path, keys, count)
    if full is not None:
        covariance, what = _full_covariance(path, full, count), "covariance"
    elif sigma is not None:
        covariance, what = _covariance(sigma, parameters, keys), "standard deviations"
    else:
        covariance = assumed_covariance(model, parameters, width_px, CALIBRATION_FILE)
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
