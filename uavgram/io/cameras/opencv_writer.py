"""`Calibration` -> a calibration file as OpenCV's samples write it, and their readers read it."""

from __future__ import annotations

import cv2
import numpy as np

from uavgram.model.camera.calibration import Calibration


def opencv_text(calibration: Calibration, created_utc: str) -> str:
    """Text of a calibration file in OpenCV's YAML, every digit.

    The keys are those of OpenCV's samples (calibration.cpp); std_deviation_intrinsics in the order
    of calibrateCameraExtended. ``intrinsics_covariance`` is this program's own addition, which
    others pass over.
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
