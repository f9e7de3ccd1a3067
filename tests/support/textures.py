"""Textures that are known at every place, so that photos of them can be made without resampling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

BLUR_PX = 0.7


@dataclass(frozen=True, eq=False)
class Texture:
    """A sum of waves on the ground; photos see it through blur and pixels of their own."""

    wave: Floats  # (k, 2) per ground unit
    phase: Floats  # (k,)
    contrast: float

    @staticmethod
    def random(seed: int, contrast: float = 25.0, finest: float = 0.45) -> Texture:
        rng = np.random.default_rng(seed)
        wave = rng.uniform(-finest, finest, (400, 2))
        return Texture(wave, rng.uniform(0, 2 * np.pi, 400), contrast)

    @staticmethod
    def stripes(period: float, contrast: float = 60.0) -> Texture:
        """Bars along v, and weak ones across, that repeat both ways."""
        wave = np.array([[1.0, 0.0], [3.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) / period
        return Texture(wave, np.array([0.3, 1.0, 2.0, 0.5]), contrast)

    def photo(
        self,
        shape: tuple[int, int],
        ground_from_pixel: Floats,
        offset: Floats,
        noise: float,
        rng: np.random.Generator,
    ) -> Image:
        """A photo (height, width) whose pixel p shows the ground at ``A p + offset``.

        Parameters
        ----------
        shape
            Of the photo.
        ground_from_pixel, offset
            (2, 2), (2,).
        noise
            Standard deviation of the grey values.
        rng
            Of the noise.
        """
        wave = self.wave @ ground_from_pixel  # per pixel
        seen = np.exp(-2 * (np.pi * BLUR_PX) ** 2 * (wave**2).sum(axis=1))
        seen *= np.sinc(wave[:, 0]) * np.sinc(wave[:, 1])
        phase = self.phase + 2 * np.pi * self.wave @ offset
        along = np.exp(2j * np.pi * np.outer(np.arange(shape[1]), wave[:, 0]))
        down = np.exp(2j * np.pi * np.outer(np.arange(shape[0]), wave[:, 1]) + 1j * phase)
        grey = ((down * seen) @ along.T).real * self.contrast * np.sqrt(2 / len(wave))
        grey = 120 + grey + rng.normal(0, noise, shape)
        return np.asarray(np.clip(np.round(grey), 0, 255), np.uint8)
