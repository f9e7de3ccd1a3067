"""Rasters of the ground plane, and painting on them.

OpenCV fills shapes up to half a pixel (1 cm of road) too far: good enough for a road and its paint.
Shapes that are measured are not painted this way (see synthetic/rendering.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uavgram.model.arrays import Floats

Image = NDArray[np.uint8]
Weights = NDArray[np.float32]

_SHIFT = 6  # OpenCV draws to 1/64 px


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundRaster:
    """Top view of part of the scene: up is x (along the road), left is y.

    Attributes
    ----------
    image
        (H, W, C): BGR, or BGRA with colours multiplied by alpha.
    x_top_m, y_left_m
        Scene coordinates of the outer edges of the first row and of the first column.
    resolution_m
        Side of a pixel.
    """

    image: Image
    x_top_m: float
    y_left_m: float
    resolution_m: float

    @property
    def pixel_from_scene(self) -> Floats:
        """(2, 3) affine matrix from scene (x, y, 1) to pixel (u, v), (0, 0) = centre of a pixel."""
        scale = 1.0 / self.resolution_m
        return np.array(
            [
                [0.0, -scale, self.y_left_m * scale - 0.5],
                [-scale, 0.0, self.x_top_m * scale - 0.5],
            ]
        )

    @property
    def corners_m(self) -> Floats:
        """(4, 2) outer corners in the scene."""
        height, width = self.image.shape[:2]
        x = self.x_top_m - np.array([0.0, 0.0, 1.0, 1.0]) * height * self.resolution_m
        y = self.y_left_m - np.array([0.0, 1.0, 1.0, 0.0]) * width * self.resolution_m
        return np.column_stack([x, y])


class Painter:
    """Painter of shapes given in scene metres into masks in the frame of one raster."""

    def __init__(self, raster: GroundRaster) -> None:
        self._affine = raster.pixel_from_scene
        self._shape = raster.image.shape[:2]
        self._resolution_m = raster.resolution_m

    def blank(self) -> Image:
        """Create an empty mask (H, W)."""
        return np.zeros(self._shape, np.uint8)

    def polygons(self, *outlines_m: Floats, mask: Image | None = None, value: int = 255) -> Image:
        """Fill closed outlines (K, 2)."""
        mask = self.blank() if mask is None else mask
        for outline in outlines_m:
            cv2.fillPoly(
                mask, [self._convert_to_fixed_point(outline)], [value], cv2.LINE_AA, _SHIFT
            )
        return mask

    def stripes(
        self, *paths_m: Floats, width_m: float, mask: Image | None = None, value: int = 255
    ) -> Image:
        """Fill paths (K, 2) of the given width.

        Parameters
        ----------
        paths_m
            (K, 2) each, in the scene.
        width_m
            Width of all stripes.
        mask
            Mask to draw into; None for a new one.
        value
            0 to 255.
        """
        return self.polygons(
            *(stripe_outline(path, width_m) for path in paths_m), mask=mask, value=value
        )

    def discs(self, centers_m: Floats, radius_m: float, mask: Image, value: int = 255) -> Image:
        """Fill circles about (K, 2).

        Parameters
        ----------
        centers_m
            (K, 2) in the scene.
        radius_m
            Radius of all discs.
        mask
            (H, W) mask to draw into.
        value
            0 to 255.
        """
        radius = round(radius_m / self._resolution_m * 2**_SHIFT)
        for center in self._convert_to_fixed_point(centers_m).tolist():
            cv2.circle(mask, center, radius, [value], -1, cv2.LINE_AA, _SHIFT)
        return mask

    def _convert_to_fixed_point(self, points_m: Floats) -> NDArray[np.int32]:
        pixel = np.atleast_2d(points_m) @ self._affine[:, :2].T + self._affine[:, 2]
        fixed: NDArray[np.int32] = np.round(pixel * 2**_SHIFT).astype(np.int32)
        return fixed


def stripe_outline(path_m: Floats, width_m: float) -> Floats:
    """Compute the outline (2K, 2) of a path (K, 2) drawn with a flat pen."""
    path = np.asarray(path_m, dtype=np.float64)
    tangent = np.gradient(path, axis=0)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    normal *= 0.5 * width_m / np.linalg.norm(normal, axis=1, keepdims=True)
    return np.vstack([path + normal, (path - normal)[::-1]])


def make_arc(
    center_m: tuple[float, float], radius_m: float, start_deg: float, end_deg: float
) -> Floats:
    """Compute points (25, 2) of an arc, angles from x towards y.

    Parameters
    ----------
    center_m
        Centre in the scene.
    radius_m
        Radius of the circle.
    start_deg, end_deg
        Angles of its ends.
    """
    angle = np.deg2rad(np.linspace(start_deg, end_deg, 25))
    return np.asarray(center_m) + radius_m * np.column_stack([np.cos(angle), np.sin(angle)])


def make_box(x0: float, x1: float, y0: float, y1: float) -> Floats:
    """Return the corners (4, 2) of a rectangle along the axes.

    Parameters
    ----------
    x0, x1, y0, y1
        Its sides, in any unit.
    """
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def blend(image: Image, layer: Image, weight: Weights) -> Image:
    """Mix two BGR images: `layer` where the weight (H, W) is 1, `image` where it is 0.

    Parameters
    ----------
    image, layer
        (H, W, 3).
    weight
        (H, W) from 0 to 1.
    """
    result: Image = cv2.blendLinear(layer, image, weight, 1.0 - weight)  # type: ignore[assignment]
    return result


def paint_layer(
    image: Image,
    paint: Image | tuple[int, ...],
    mask: Image,
    strength: float | Weights = 1.0,
) -> None:
    """Paint one colour, or another image, over an image in place.

    Parameters
    ----------
    image
        (H, W, C), changed.
    paint
        A colour of C channels, or an image of the same size.
    mask
        (H, W) coverage, 0 to 255.
    strength
        Opacity, 0 to 1, everywhere or for each pixel.
    """
    # Most shapes are small: change only their part of the image.
    x, y, width, height = cv2.boundingRect(mask)
    part = np.s_[y : y + height, x : x + width]
    if not width:
        return
    opacity = strength if isinstance(strength, float) else strength[part]
    weight: Weights = mask[part] * (np.asarray(opacity, np.float32) / np.float32(255.0))
    if isinstance(paint, tuple):
        # Takes a third of the time of np.full with a colour.
        layer = cv2.merge([np.full(weight.shape, channel, np.uint8) for channel in paint])
    else:
        layer = np.ascontiguousarray(paint[part])
    below = np.ascontiguousarray(image[part])
    image[part] = blend(below, layer, weight)  # type: ignore[arg-type]


def blur_mask(mask: Image, sigma_px: float) -> Image:
    """Blur a mask's edges."""
    return np.asarray(cv2.GaussianBlur(mask, (0, 0), sigma_px), np.uint8)


def make_texture(
    rng: np.random.Generator, shape: tuple[int, int], weights: dict[float, float]
) -> Weights:
    """Create a random texture (H, W): a sum of smooth noise of several grain sizes.

    Parameters
    ----------
    rng
        Random generator of the noise.
    shape
        Height and width [px].
    weights
        Standard deviation of each noise, by its grain [px].
    """
    total = np.zeros(shape, np.float32)
    for grain, weight in weights.items():
        size = tuple(int(np.ceil(n / grain)) + 2 for n in shape)
        noise = rng.standard_normal(size, dtype=np.float32)
        if grain > 1:
            whole = (round(size[1] * grain), round(size[0] * grain))
            smooth = cv2.resize(noise, whole, interpolation=cv2.INTER_CUBIC)
            noise = np.asarray(smooth, np.float32)
        cv2.scaleAdd(np.ascontiguousarray(noise[: shape[0], : shape[1]]), weight, total, total)
    return total


def colour_noise(noise: Weights, *colors_bgr: tuple[int, int, int]) -> Image:
    """Colour a noise of about unit variance: values -2.5 to 2.5 run through the colours."""
    level = cv2.convertScaleAbs(noise + 2.5, alpha=255 / 5.0)
    stops = np.linspace(0, 255, len(colors_bgr))
    table = [np.interp(np.arange(256), stops, channel) for channel in zip(*colors_bgr, strict=True)]
    lut = np.round(np.stack(table, axis=1)).astype(np.uint8)[:, None, :]
    result: Image = cv2.applyColorMap(level, lut)  # type: ignore[assignment]
    return result
