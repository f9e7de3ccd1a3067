"""Decoded photos of a top view at its resolution, and a brightness factor for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, triu

from uavgram.geometry.ground.top_view import View
from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.photos.decoding import read_reduced
from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats, Ints
from uavgram.model.maps import GroundRaster

CACHE_BYTES = 1_000_000_000

MARGIN_PX = 1

Map = NDArray[np.float32]

MAX_FAST_REDUCTION = 8
"""Strongest reduction of the decoder: a JPEG at 1/2, 1/4 or 1/8 of its size decodes faster."""


class Photo(NamedTuple):
    """Decoded photo in the orientation of the stored pixels.

    Attributes
    ----------
    rgba
        (H + 2, W + 2, 4), opaque; its outermost pixels are repeated, so that sampling within half a
        pixel of the border finds neighbours.
    scale
        Original pixels per pixel along u and v. With (0, 0) the centre of the top-left pixel in
        both: original = (reduced + 0.5) * scale - 0.5.
    """

    rgba: Pixels
    scale: tuple[float, float]

    def sample(self, u_px: Map, v_px: Map) -> Pixels:
        """Sample (h, w, 4) bilinearly at original pixels (h, w), up to half a pixel outside."""
        across, down = np.float32(1.0 / self.scale[0]), np.float32(1.0 / self.scale[1])
        margin, half = np.float32(MARGIN_PX), np.float32(0.5)
        # (u + half) / scale - half + margin
        u = u_px * across + (half * across - half + margin)
        v = v_px * down + (half * down - half + margin)
        # a constant border is OpenCV's fastest mode; the border is never reached
        return np.asarray(cv2.remap(self.rgba, u, v, cv2.INTER_LINEAR), np.uint8)


PhotoCache = LruCache[int, Photo]
"""Photos by index, decoded once while they are kept; for several threads."""


def create_photo_cache(
    paths: Sequence[str],
    reductions: Sequence[int],
    most_bytes: int = CACHE_BYTES,
    gains: Sequence[float] | None = None,
) -> PhotoCache:
    """Create a cache of photos that are decoded on request.

    Parameters
    ----------
    paths
        (N,) of the photos.
    reductions
        (N,) powers of two: this many original pixels become one.
    most_bytes
        Memory limit of the kept photos; at least one is kept.
    gains
        (N,) factors of their brightness; by default they stay unchanged.
    """

    def read(k: int) -> Photo:
        photo = read_photo(paths[k], reductions[k])
        return photo if gains is None else photo._replace(rgba=apply_gain(photo.rgba, gains[k]))

    return LruCache(read, lambda photo: photo.rgba.nbytes, most_bytes)


def apply_gain(rgba: Pixels, gain: float) -> Pixels:
    """Multiply red, green and blue of (H, W, 4) by a gain.

    Parameters
    ----------
    rgba
        RGB and opacity.
    gain
        Factor of the colours.
    """
    table = np.clip(np.arange(256.0) * gain + 0.5, 0, 255).astype(np.uint8)
    opacity = np.arange(256, dtype=np.uint8)
    tables = np.stack([table, table, table, opacity], axis=-1)[None]
    return np.asarray(cv2.LUT(rgba, tables), np.uint8)


def read_photo(path: str, reduction: int = 1) -> Photo:
    """Decode a photo, `reduction` by `reduction` original pixels averaged into one.

    Raises
    ------
    InputError
        The file cannot be read, or is not a photo.
    """
    pixels, quick = read_reduced(path, lambda _: min(reduction, MAX_FAST_REDUCTION))
    height, width = pixels.shape[:2]
    # libjpeg's last column may cover a partial block: its pixels have the full width all the same
    scale = float(quick), float(quick)
    if reduction > quick:
        shape = -(-width * quick // reduction), -(-height * quick // reduction)
        scale = width * quick / shape[0], height * quick / shape[1]
        pixels = np.asarray(cv2.resize(pixels, shape, interpolation=cv2.INTER_AREA), np.uint8)
    return Photo(_add_margin(pixels), scale)


def _add_margin(bgr: Pixels) -> Pixels:
    """Convert to RGB and opacity (H + 2, W + 2, 4), with the outermost pixels repeated."""
    height, width = bgr.shape[:2]
    out = np.empty((height + 2 * MARGIN_PX, width + 2 * MARGIN_PX, 4), np.uint8)
    cv2.cvtColor(bgr, cv2.COLOR_BGR2RGBA, dst=out[1:-1, 1:-1])
    out[0, 1:-1], out[-1, 1:-1] = out[1, 1:-1], out[-2, 1:-1]
    out[:, 0], out[:, -1] = out[:, 1], out[:, -2]
    return out


LEAST_GREY, MOST_GREY = 8.0, 247.0
"""Least and largest usable grey value: darker or brighter ones may be clipped."""

MIN_PLACES = 12
"""Least number of common places for the comparison of two photos."""

MAX_GAIN = 2.5

DENSE_PHOTOS = 500
"""Number of photos up to which their factors are solved for with a full matrix."""


class Light(NamedTuple):
    """Places (n,) that a photo shows, increasing, and the logarithm of its grey value there."""

    place: Ints
    log_grey: Floats


def select_light(place: Ints, colours: Pixels | Floats) -> Light:
    """Select the (n, 3) colours at (n,) places that are not clipped."""
    grey = np.asarray(colours, dtype=np.float64).mean(axis=1)
    good = (grey > LEAST_GREY) & (grey < MOST_GREY)
    return Light(place[good], np.log(grey[good]))


def estimate_gains(seen: Mapping[int, Light], count: int) -> Floats:
    """Compute brightness factors (N,) that make photos agree where they show the same ground.

    Least squares on logarithms: the difference of the gains of two photos is the median ratio of
    their grey values at common places, weighted by their number. The mean gain is fixed by a weak
    observation of each gain as one.

    Parameters
    ----------
    seen
        Light of each photo; photos that show nothing are missing.
    count
        N, the number of all photos.
    """
    photos = list(seen)
    normal: dict[tuple[int, int], float] = {(k, k): 1.0 for k in range(count)}
    right = np.zeros(count)
    for one, other in _overlapping([seen[photo].place for photo in photos]):
        a, b = photos[one], photos[other]
        _, in_a, in_b = np.intersect1d(
            seen[a].place, seen[b].place, assume_unique=True, return_indices=True
        )
        difference = float(np.median(seen[b].log_grey[in_b] - seen[a].log_grey[in_a]))
        weight = float(len(in_a))
        # Normal equations of the observation log gain_a - log gain_b = difference.
        normal[a, a] += weight
        normal[b, b] += weight
        normal[a, b] = normal[b, a] = -weight
        right[a] += weight * difference
        right[b] -= weight * difference
    row, column = np.array(list(normal)).T.reshape(2, -1)
    whole = coo_array((list(normal.values()), (row, column)), shape=(count, count))
    gains = np.exp(_solve_symmetric(whole, right))
    return np.asarray(np.clip(gains, 1.0 / MAX_GAIN, MAX_GAIN))


def _solve_symmetric(whole: coo_array, right: Floats) -> Floats:
    """Solve a symmetric system (N,)."""
    if len(right) <= DENSE_PHOTOS:
        return np.asarray(np.linalg.solve(whole.toarray(), right))
    from scipy.sparse.linalg import spsolve  # noqa: PLC0415 - slow to load

    return np.asarray(spsolve(whole.tocsc(), right))


def _overlapping(places: list[Ints]) -> list[tuple[int, int]]:
    """Find the pairs of photos with enough common places: few among thousands of photos."""
    photo = np.repeat(np.arange(len(places)), [len(each) for each in places])
    place = np.concatenate([np.zeros(0, np.int64), *places])
    size = len(places), int(place.max(initial=0)) + 1
    shows = coo_array((np.ones(len(photo)), (photo, place)), shape=size).tocsr()
    # Sparse product: number of common places of each pair.
    common = triu(shows @ shows.T, 1).tocoo()
    is_enough = common.data >= MIN_PLACES
    pairs = np.column_stack([common.row, common.col])[is_enough]
    return [(int(a), int(b)) for a, b in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]]


LIGHT_NODES = 96
"""Number of nodes along the longer side of the ground at which photos are compared."""


def estimate_exposure_gains(view: View, raster: GroundRaster, photos: PhotoCache) -> Floats:
    """Compute brightness factors (N,) that make photos agree where they show the same ground.

    Parameters
    ----------
    view
        Photos.
    raster
        Ground to be shown.
    photos
        Photos by index of the view; small ones suffice.
    """
    coarse = raster.coarser(max(max(raster.width, raster.height) // LIGHT_NODES, 1))
    world = view.ground(coarse, np.arange(float(coarse.width)), np.arange(float(coarse.height)))
    seen = {k: light for k in range(len(view.rows)) if (light := _light(view, k, world, photos))}
    return estimate_gains(seen, len(view.rows))


def _light(view: View, index: int, world: Floats, photos: PhotoCache) -> Light | None:
    """Sample a photo's brightness at the nodes; None where it shows none of them."""
    pixel, off_nadir = view.look(index, world)
    shown = view.shows(pixel[..., 0], pixel[..., 1], off_nadir)
    if not shown.any():
        return None
    at = np.flatnonzero(shown)
    u, v = (pixel[..., k].reshape(-1)[at].astype(np.float32)[:, None] for k in range(2))
    return select_light(at, photos.get(index).sample(u, v)[:, 0, :3])
