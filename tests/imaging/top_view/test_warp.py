"""Windows of a top view against warps of every single pixel by OpenCV's projection and scipy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NotRequired, TypedDict

import numpy as np
import pytest
from top_views import (
    SIZE_PX,
    UTM,
    cv_project,
    exact_warp,
    looking,
    make_view,
    pattern,
    world_of,
    write_photo,
)

from uavgram.errors import InputError
from uavgram.geometry.ground.top_view import MAX_OFF_NADIR, View
from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.top_view.brightness import (
    MARGIN_PX,
    PhotoCache,
    create_photo_cache,
    read_photo,
)
from uavgram.imaging.top_view.warp import REACH, make_lattice, project_window, warp_window
from uavgram.io.files import photo_files
from uavgram.model.arrays import Floats
from uavgram.model.maps import GroundRaster
from uavgram.stages.products.top_view import lay_raster


class Case(TypedDict):
    """A photo: how it was taken, and where the ground lies."""

    rotation: Floats
    lens: str
    crs: NotRequired[str]


PLANE, PIVOT = (1.0, 0.05, -0.02), (2.0, 1.0)
CASES: dict[str, Case] = {
    "nadir": {"rotation": looking(3, 40, 2), "lens": "brown"},
    "on the map": {"rotation": looking(3, 40, 2), "lens": "brown", "crs": UTM},
    "oblique": {"rotation": looking(40, 100), "lens": "brown"},
    "horizon": {"rotation": looking(72, 10), "lens": "brown"},
    "fisheye": {"rotation": looking(20, 300), "lens": "fisheye"},
    "folded": {"rotation": looking(3, 40), "lens": "folded"},
}


def scene(
    tmp_path: Path, rotation: Floats, lens: str, crs: str | None = None, rgb: Pixels | None = None
) -> View:
    path = write_photo(tmp_path / "a.png", pattern() if rgb is None else rgb)
    at = [[1.0, -2.0, 31.0]]
    return make_view(at, [rotation], lens=lens, plane=PLANE, pivot=PIVOT, crs=crs, paths=[path])


def cache(view: View, reduction: int = 1) -> PhotoCache:
    paths = photo_files(view.result.frames)
    return create_photo_cache(paths, [reduction] * len(paths))


def whole(view: View, raster: GroundRaster, photos: PhotoCache | None = None) -> Pixels:
    """(height, width, 4) the top view put together from windows that do not divide it."""
    out = np.zeros((raster.height, raster.width, 4), np.uint8)
    photos = photos or cache(view)
    everyone = np.arange(len(view.rows))
    for row in range(0, raster.height, 200):
        for column in range(0, raster.width, 230):
            w, h = min(230, raster.width - column), min(200, raster.height - row)
            got = warp_window(view, raster, (column, row, w, h), everyone, photos)
            out[row : row + h, column : column + w] = got
    return out


@pytest.mark.parametrize("name", CASES)
def test_a_top_view_is_the_exact_warp_of_every_pixel(tmp_path: Path, name: str) -> None:
    case = CASES[name]
    view = scene(tmp_path, **case)
    raster = lay_raster(view, {"horizon": 0.4, "fisheye": 0.4, "oblique": 0.15}.get(name, 0.1))
    exact, pixel = exact_warp(view, raster, case["lens"], 0, pattern())

    got = whole(view, raster)

    clear = (pixel > 0).all(axis=-1) & (pixel < np.array(SIZE_PX) - 1).all(axis=-1)
    beyond = ~((pixel > -1.5) & (pixel < np.array(SIZE_PX) + 0.5)).all(axis=-1)
    ground = exact_steepness(view, raster)
    shown = got[..., 3] == 255
    assert set(np.unique(got[..., 3])) <= {0, 255}
    assert not got[~shown].any()
    assert not (shown & beyond).any()
    if name == "folded":  # OpenCV's formula folds back into the photo, where nothing was seen
        radius = np.hypot(*np.moveaxis(camera_rays(view, raster), -1, 0))
        fold = np.sqrt(1 / (3 * 0.62))
        assert not shown[radius > fold * 1.001].any()
        clear &= radius < fold * 0.99
        assert (clear.sum() / shown.sum()) > 0.9
    clear &= ground < 0.99 * MAX_OFF_NADIR
    assert shown[clear].all()
    assert not shown[ground > 1.01 * MAX_OFF_NADIR].any()
    assert clear.sum() > 15_000
    apart = np.abs(got[..., :3].astype(float) - exact)[clear]
    # half a grey value of rounding, and 1/32 px of OpenCV's table of weights
    assert np.percentile(apart, 99.9) < 1.5
    assert apart.max() < 3.0


def camera_rays(view: View, raster: GroundRaster) -> Floats:
    """(h, w, 2) x / z and y / z in the camera."""
    row, column = np.mgrid[: raster.height, : raster.width].reshape(2, -1).astype(float)
    poses = view.result.frames.refined
    camera = (world_of(view, raster, column, row) - poses.center_world_m[0]) @ (
        poses.world_from_camera[0]
    )
    ray: Floats = (camera[:, :2] / camera[:, 2:]).reshape(raster.height, raster.width, 2)
    return ray


def exact_steepness(view: View, raster: GroundRaster) -> Floats:
    row, column = np.mgrid[: raster.height, : raster.width].reshape(2, -1).astype(float)
    away = world_of(view, raster, column, row) - view.result.frames.refined.center_world_m[0]
    steep: Floats = np.hypot(away[:, 0], away[:, 1]) / -away[:, 2]
    return steep.reshape(raster.height, raster.width)


@pytest.mark.parametrize("size", [0.02, 0.3, 1.0, 3.0])
@pytest.mark.parametrize("name", ["nadir", "oblique", "fisheye"])
def test_places_between_the_nodes_are_good_to_a_hundredth_of_a_pixel(
    tmp_path: Path, name: str, size: float
) -> None:
    case = CASES[name]
    view = scene(tmp_path, **case)
    ahead = 31 * np.tan(np.radians(40)) if name == "oblique" else 0.0
    raster = GroundRaster(
        west_m=ahead - 15, north_m=15, pixel_m=size, width=300, height=300, crs=None
    )
    window = (0, 0, min(300, round(30 / size)), min(300, round(30 / size)))
    (sight,) = project_window(view, raster, window, np.array([0]))
    maps = sight.maps()

    row, column = np.mgrid[: window[3], : window[2]].reshape(2, -1).astype(float)
    poses = view.result.frames.refined
    exact = cv_project(
        case["lens"], poses.center_world_m[0], poses.world_from_camera[0],
        world_of(view, raster, column, row),
    ).reshape(*maps.u.shape, 2)  # fmt: skip

    apart = np.hypot(maps.u - exact[..., 0], maps.v - exact[..., 1])
    # what lies in the photo, with a margin; far outside, a polynomial lens runs wild
    near = ((exact > -200) & (exact < np.array(SIZE_PX) + 200)).all(axis=-1)
    assert near.any()
    assert apart[near].max() < 0.01


def test_nodes_are_close_where_a_pixel_is_coarse_for_the_height(tmp_path: Path) -> None:
    view = scene(tmp_path, **CASES["nadir"])
    steps = [
        make_lattice(
            view,
            GroundRaster(west_m=0, north_m=0, pixel_m=p, width=9, height=9, crs=None),
            (0, 0, 9, 9),
        ).step
        for p in (0.01, 0.1, 0.3, 2.0)
    ]
    assert steps == [32, 9, 3, 1]


def two(
    tmp_path: Path,
    greys: tuple[int, ...],
    centers: Sequence[tuple[float, float, float]] = ((-6.0, 0, 30.0), (6.0, 1.0, 30.0)),
    rotations: list[Floats] | None = None,
) -> View:
    """Photos of one grey value each."""
    paths = [
        write_photo(tmp_path / f"{k}.png", np.full((SIZE_PX[1], SIZE_PX[0], 3), grey, np.uint8))
        for k, grey in enumerate(greys)
    ]
    turns = rotations or [looking()] * len(greys)
    return make_view(centers, turns, paths=paths)


def tangents(view: View, raster: GroundRaster) -> tuple[Floats, Floats]:
    """(h, w, photos) tangent from the vertical, and whether each photo shows it, by OpenCV."""
    row, column = np.mgrid[: raster.height, : raster.width].reshape(2, -1).astype(float)
    world = world_of(view, raster, column, row)
    poses = view.result.frames.refined
    tangent, inner = [], []
    for center, rotation in zip(poses.center_world_m, poses.world_from_camera, strict=True):
        away = world - center
        pixel = cv_project("brown", center, rotation, world)
        tangent.append(np.hypot(away[:, 0], away[:, 1]) / -away[:, 2])
        inner.append(np.minimum(pixel + 0.5, np.array(SIZE_PX) - 0.5 - pixel).min(axis=1))
    shape = raster.height, raster.width, -1
    return np.stack(tangent, -1).reshape(shape), np.stack(inner, -1).reshape(shape)


def test_each_spot_comes_from_the_photo_most_above_it(tmp_path: Path) -> None:
    greys = (40, 130, 220)
    view = two(tmp_path, greys, ((-7.0, 0, 30.0), (7.0, 1.0, 31.0), (1.0, 9.0, 29.0)))
    raster = lay_raster(view, 0.1)
    tangent, inner = tangents(view, raster)
    got = whole(view, raster)[..., 0]

    # away from seams and from every photo's rim
    seen = np.where(inner > 0, tangent, 99.0)
    order = np.sort(seen, axis=-1)
    clear = (order[..., 1] - order[..., 0] > REACH) & (inner.max(axis=-1) > 20)
    winner = seen.argmin(axis=-1)
    clear &= np.take_along_axis(inner, winner[..., None], -1)[..., 0] > 20
    assert clear.mean() > 0.5
    np.testing.assert_array_equal(got[clear], np.array(greys)[winner[clear]])


def test_seams_fade_from_one_brightness_into_the_other(tmp_path: Path) -> None:
    view = two(tmp_path, (60, 200))
    raster = lay_raster(view, 0.05)
    got = whole(view, raster)
    middle = got[raster.height // 2 - 40 : raster.height // 2 + 40, :, :]
    inside = (middle[..., 3] == 255).all(axis=0)
    grey = middle[:, inside, 0].astype(int)

    step = np.abs(np.diff(grey, axis=1)).max()
    assert grey.min() == 60
    assert grey.max() == 200
    assert step <= 140 * 0.2  # a tenth of a metre a few pixels wide would be a step
    across = ((grey > 62) & (grey < 198)).sum(axis=1) * raster.pixel_m
    assert (across > 0.4).all()
    assert (np.diff(grey, axis=1) >= 0).all()


def test_a_photo_that_ends_fades_into_the_one_below_it(tmp_path: Path) -> None:
    # the first is much nearer to the vertical where it ends than the second, which looks sideways
    view = two(
        tmp_path, (60, 200), ((0.0, 0, 30.0), (45.0, 0.0, 30.0)), [looking(), looking(40, 270)]
    )
    raster = lay_raster(view, 0.05)
    row = GroundRaster(west_m=10.0, north_m=0.2, pixel_m=0.05, width=300, height=9, crs=None)
    tangent, inner = tangents(view, row)
    (end,) = np.flatnonzero(np.diff((inner[4, :, 0] > 0).astype(int)))
    assert tangent[4, end, 1] - tangent[4, end, 0] > 2 * REACH  # else an ordinary seam is tested
    assert inner[4, end - 50 : end + 50, 1].min() > 30

    grey = whole(view, row)[4, end - 50 : end + 50, 0].astype(int)

    assert grey[0] == 60
    assert grey[-1] == 200
    rim_px = 0.03 * SIZE_PX[1]
    assert np.abs(np.diff(grey)).max() < 140 / rim_px * 2
    assert whole(view, raster)[..., 3].any()


@pytest.mark.parametrize(("lens", "tilt"), [("brown", 5), ("folded", 5), ("brown", 72)])
def test_a_mosaic_shows_all_that_any_of_its_photos_shows(
    tmp_path: Path, lens: str, tilt: float
) -> None:
    centers, turns = [[-6.0, 0, 30.0], [6.0, 1.0, 30.0]], [looking(tilt, 20), looking(tilt, 340)]
    path = write_photo(tmp_path / "a.png", np.full((SIZE_PX[1], SIZE_PX[0], 3), 80, np.uint8))
    both = make_view(centers, turns, lens=lens, paths=[path, path])
    raster = lay_raster(both, 0.4 if tilt > 50 else 0.1)
    photos = cache(both)
    window = (0, 0, raster.width, raster.height)
    alone = np.stack([warp_window(both, raster, window, np.array([k]), photos) for k in (0, 1)])

    together = whole(both, raster, photos)

    np.testing.assert_array_equal(together[..., 3], alone[..., 3].max(axis=0))
    assert (together[together[..., 3] > 0][:, :3] == 80).all()
    assert (alone[..., 3].min(axis=0) > 0).any()


def test_windows_join_without_a_trace(tmp_path: Path) -> None:
    view = two(tmp_path, (60, 200), rotations=[looking(4, 30), looking(6, 250)])
    raster = lay_raster(view, 0.05)
    photos = cache(view)
    size = raster.width, raster.height
    one = warp_window(view, raster, (0, 0, *size), np.arange(2), photos)

    many = whole(view, raster, photos)

    apart = np.abs(one.astype(int) - many.astype(int))
    assert apart[..., 3].max() == 0 or (apart[..., 3] > 0).sum() < 5  # on the very border
    assert np.percentile(apart[..., :3], 99.99) <= 1


def test_a_coarse_top_view_averages_the_photo_instead_of_skipping_pixels(tmp_path: Path) -> None:
    u, v = np.meshgrid(np.arange(SIZE_PX[0]), np.arange(SIZE_PX[1]))
    rgb = np.repeat(((u + v) % 2 * 255).astype(np.uint8)[..., None], 3, axis=2)
    view = scene(tmp_path, looking(), "brown", rgb=rgb)
    raster = lay_raster(view, 0.4)

    got = whole(view, raster, cache(view, 8))
    skipped = whole(view, raster, cache(view, 1))

    middle = np.s_[20:-20, 20:-20, 0]
    assert np.ptp(got[middle].astype(int)) <= 4
    assert np.ptp(skipped[middle].astype(int)) > 100  # so the test can fail


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
@pytest.mark.parametrize("reduction", [2, 8, 16])
def test_reduced_photos_lie_where_the_whole_ones_do(
    tmp_path: Path, suffix: str, reduction: int
) -> None:
    u, v = np.meshgrid(np.arange(SIZE_PX[0]), np.arange(SIZE_PX[1]))
    slopes = [np.minimum(4 * np.abs(axis % 128 - 64), 255) for axis in (u, v)]
    path = write_photo(tmp_path / f"a{suffix}", np.stack([*slopes, 0 * u], -1).astype(np.uint8))
    # half-way up the slopes, which rise by four grey values a pixel
    at = np.meshgrid(96 + 128 * np.arange(5), 96 + 128 * np.arange(4))
    place = [np.asarray(a, np.float32) for a in at]

    photo = read_photo(path, reduction)

    assert photo.rgba.shape[1] - 2 * MARGIN_PX == SIZE_PX[0] // reduction
    apart = photo.sample(*place)[..., :2].astype(float) - read_photo(path).sample(*place)[..., :2]
    assert np.abs(apart.mean(axis=(0, 1))).max() <= 1.0  # half a pixel of the photo would be two


def test_the_outermost_half_pixels_are_as_bright_as_the_border(tmp_path: Path) -> None:
    path = write_photo(tmp_path / "a.png", np.full((6, 8, 3), 200, np.uint8))
    sides = (np.array(side, np.float32) for side in ([-0.5, 0, 7, 7.5], [-0.5, 0, 5, 5.5]))
    u, v = np.meshgrid(*sides)

    assert (read_photo(path).sample(u, v) == [200, 200, 200, 255]).all()


def test_the_stored_pixels_count_whatever_the_tag_of_orientation_says(tmp_path: Path) -> None:
    from PIL import Image

    image = Image.fromarray(pattern())
    exif = image.getexif()
    exif[0x0112] = 6
    image.save(tmp_path / "a.jpg", exif=exif, quality=95)

    assert read_photo(str(tmp_path / "a.jpg")).rgba.shape[:2] == (SIZE_PX[1] + 2, SIZE_PX[0] + 2)
    assert read_photo(str(tmp_path / "a.jpg"), 2).rgba.shape[:2] == (
        SIZE_PX[1] // 2 + 2,
        SIZE_PX[0] // 2 + 2,
    )


def test_a_photo_that_is_gone_or_none_is_told_by_name_each_time(tmp_path: Path) -> None:
    (tmp_path / "text.jpg").write_text("no photo")
    (tmp_path / "empty.jpg").write_bytes(b"")
    names = [str(tmp_path / name) for name in ("gone.jpg", "text.jpg", "empty.jpg")]
    photos = create_photo_cache(names, [1, 1, 4])
    for index, said in ((0, r"gone\.jpg: cannot be read"), (1, r"text\.jpg: is no photo")):
        for _ in range(2):
            with pytest.raises(InputError, match=said):
                photos.get(index)
    with pytest.raises(InputError, match=r"empty\.jpg"):
        photos.get(2)


def test_a_photo_that_could_not_be_read_is_read_once_it_can_be(tmp_path: Path) -> None:
    path = tmp_path / "late.png"
    photos = create_photo_cache([str(path)], [1])
    with pytest.raises(InputError, match=r"late\.png: cannot be read"):
        photos.get(0)
    write_photo(path, pattern())

    assert photos.get(0).rgba.shape[2] == 4


def test_the_cache_keeps_what_was_used_last(tmp_path: Path) -> None:
    paths = [write_photo(tmp_path / f"{k}.png", pattern(k)) for k in range(3)]
    one = read_photo(paths[0]).rgba.nbytes
    photos = create_photo_cache(paths, [1] * 3, most_bytes=2 * one)
    first, _, third = photos.get(0), photos.get(1), photos.get(2)

    assert photos.get(2).rgba is third.rgba
    assert photos.get(0).rgba is not first.rgba


def test_nothing_is_decoded_for_a_window_without_a_photo(tmp_path: Path) -> None:
    view = make_view([[0, 0, 30.0]], [looking()], paths=[str(tmp_path / "gone.png")])
    raster = lay_raster(view, 0.1)
    far = replace(raster, west_m=raster.west_m + 500)

    got = warp_window(view, far, (0, 0, 50, 40), np.array([0]), cache(view))

    assert got.shape == (40, 50, 4)
    assert not got.any()
    assert not warp_window(view, far, (0, 0, 9, 9), np.array([], int), cache(view)).any()
