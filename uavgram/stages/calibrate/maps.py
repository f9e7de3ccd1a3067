"""What is known over the image."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.network import CELLS
from uavgram.estimation.calibration.projection_uncertainty import projection_covariance, worst_sigma
from uavgram.estimation.calibration.systematics import residual_map
from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration import Calibration
from uavgram.model.camera.calibration_result import ImageMaps
from uavgram.stages.calibrate.assessed import AssessedCalibration


def image_maps(judged: AssessedCalibration, camera: Calibration) -> ImageMaps:
    """Corners, mean residuals and projection uncertainty by cell of the image."""
    columns, rows = CELLS
    found = residual_map(judged.fit, judged.size_px, CELLS)
    size = np.array(judged.size_px)
    u, v = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    cell = np.stack([u, v], axis=-1) / CELLS * size - 0.5
    return ImageMaps(
        cell_px=cell,
        corners=found.corners,
        residual_px=found.mean_px,
        residual_probability=found.probability,
        uncertainty_px=_uncertainty(camera, cell),
    )


def _uncertainty(camera: Calibration, cell: Floats) -> Floats:
    """(R, C) largest standard deviation of the grid's pixels within each cell."""
    rows, columns = cell.shape[:2]
    try:
        pixel, covariance = projection_covariance(camera)
    except GeometryError:  # hardly a pixel has a ray: remarks say so
        return np.full((rows, columns), np.nan)
    size = np.array([camera.width_px, camera.height_px])
    at = np.clip((pixel + 0.5) / size * (columns, rows), 0, (columns - 1, rows - 1)).astype(int)
    result = np.full((rows, columns), -np.inf)
    np.maximum.at(result, (at[:, 1], at[:, 0]), worst_sigma(covariance))
    return np.where(np.isfinite(result), result, np.nan)
