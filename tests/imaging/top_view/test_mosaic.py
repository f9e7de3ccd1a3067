"""The ground put together from photos of a known ground."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey

from uavgram.imaging.photos.preview import Preview, decode_preview
from uavgram.imaging.top_view import mosaic
from uavgram.imaging.top_view.brightness import DENSE_PHOTOS, Light, estimate_gains
from uavgram.imaging.top_view.mosaic import (
    Box,
    Cameras,
    Grid,
    GroundTexture,
    Mosaic,
    choose_frames,
    find_boxes_below,
)
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result

SCALE = 4
SHAPE = synthetic_survey.HEIGHT_PX // SCALE, synthetic_survey.WIDTH_PX // SCALE


@pytest.fixture(scope="module")
def result() -> Result:
    return synthetic_survey.build()


@pytest.fixture(scope="module")
def photos(result: Result) -> dict[str, Preview]:
    return previews(result)


def previews(
    result: Result, paint: Callable[[int], tuple[int, int, int]] | None = None
) -> dict[str, Preview]:
    made = {}
    for i in np.flatnonzero(result.has_refined):
        poses = result.frames.refined
        if paint is None:
            pose = poses.center_world_m[i], poses.world_from_camera[i]
            rgb = synthetic_survey.render(*pose, SCALE)
        else:
            rgb = np.full((*SHAPE, 3), paint(int(i)), np.uint8)
        made[result.frames.frame_id[i]] = Preview(
            synthetic_survey.jpeg(rgb), rgb.shape[1], rgb.shape[0], (float(SCALE), float(SCALE))
        )
    return made


def ground_texture(result: Result, photos: dict[str, Preview], *size: int) -> GroundTexture:
    """The mosaic of these photos, added from the last to the first."""
    texture = texture_of(result, photos, *size)
    assert texture is not None
    return texture


def texture_of(result: Result, photos: dict[str, Preview], *size: int) -> GroundTexture | None:
    made = Mosaic(result, photos, SCALE, *size)
    for name in reversed(photos):
        made.add(name, decode_preview(photos[name])[..., ::-1])
    return made.texture()


def spots(texture: GroundTexture) -> Floats:
    """(H, W, 2) world east and north of the pixels' centres."""
    rows, columns = texture.covered.shape
    east = texture.west_m + (np.arange(columns) + 0.5) * texture.pixel_size_m
    north = texture.north_m - (np.arange(rows) + 0.5) * texture.pixel_size_m
    return np.stack(np.meshgrid(east, north), axis=-1)


def test_the_mosaic_shows_the_ground_where_it_is(
    result: Result, photos: dict[str, Preview]
) -> None:
    texture = ground_texture(result, photos)
    at = spots(texture)
    truth = synthetic_survey.ground_rgb(at[..., 0], at[..., 1]).astype(float)
    difference = np.abs(texture.rgb - truth).mean(axis=-1)[texture.covered]

    assert texture.covered.mean() > 0.6
    assert np.median(difference) < 3
    # the brown field's western edge, at east -29, to a pixel
    row = np.argmin(np.abs(at[:, 0, 1] + 18))
    red = texture.rgb[row, :, 0].astype(int)
    edge = at[row, np.argmax((red > 110) & (at[row, :, 0] < -20)), 0]
    assert edge == pytest.approx(-29, abs=1.5 * texture.pixel_size_m)


def test_each_spot_comes_from_the_frame_most_above_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mosaic, "estimate_gains", lambda _, count: np.ones(count))
    result = synthetic_survey.build(clean=True)
    texture = ground_texture(result, previews(result, paint=lambda i: (12 * i, 60, 60)))
    at = spots(texture)[8::16, 8::16]
    shown = texture.rgb[8::16, 8::16, 0].astype(float) / 12
    centers = result.frames.refined.center_world_m
    away = np.linalg.norm(at[:, :, None] - centers[:, :2], axis=-1) / centers[:, 2]
    first, second = np.sort(away, axis=-1)[..., :2].transpose(2, 0, 1)
    # well inside the photo below, and well away from where the next frame fades in
    inside = texture.covered[8::16, 8::16] & (first < 0.2) & (second - first > 0.08)
    nearest = away.argmin(axis=-1)

    assert inside.sum() > 100
    assert np.mean(np.round(shown[inside]) == nearest[inside]) > 0.97


def test_frames_fade_into_each_other_at_seams() -> None:
    result = synthetic_survey.build(clean=True)
    texture = ground_texture(result, previews(result, paint=lambda i: (200 * (i % 2),) * 3))
    red, covered = texture.rgb[..., 0].astype(int), texture.covered
    step = np.abs(np.diff(red, axis=1))[covered[:, 1:] & covered[:, :-1]]

    assert red[covered].max() == 200
    assert red[covered].min() == 0
    assert np.quantile(step, 0.999) < 20  # a hard seam steps by 200


def test_photos_of_other_exposures_give_one_ground(
    result: Result, photos: dict[str, Preview]
) -> None:
    exposure = [1.0, 0.72, 1.2]
    plain, uneven = Mosaic(result, photos, SCALE), Mosaic(result, photos, SCALE)
    for k, (name, photo) in enumerate(photos.items()):
        pixels = decode_preview(photo)[..., ::-1]
        plain.add(name, pixels)
        lit = np.clip(pixels * exposure[k % 3], 0, 255).astype(np.uint8)
        uneven.add(name, lit)
    wanted, made = plain.texture(), uneven.texture()
    assert wanted is not None
    assert made is not None
    both = wanted.covered & (wanted.rgb.max(axis=-1) < 200) & (wanted.rgb.min(axis=-1) > 20)
    ratio = made.rgb[both].astype(float).mean(axis=-1) / wanted.rgb[both].mean(axis=-1)

    assert np.percentile(ratio, [10, 90]) / np.median(ratio) == pytest.approx([1, 1], abs=0.05)


def test_a_sloping_plane_is_met_at_its_slope(result: Result) -> None:
    plane = replace(
        result.plane,
        height_m=replace(result.plane.height_m, value=np.array([2.0])),
        slope_deg=replace(result.plane.slope_deg, value=np.array([45.0, 0.0])),
        pivot_m=np.array([10.0, 0.0]),
    )
    height = plane.height_at(np.array([[10.0, 5.0], [13.0, -7.0]]))

    np.testing.assert_allclose(height, [2.0, 5.0])


def test_the_mosaic_stays_within_its_size(result: Result, photos: dict[str, Preview]) -> None:
    texture = ground_texture(result, photos, 200)

    assert max(texture.covered.shape) <= 200 + mosaic.CELL_PX


def test_without_photos_or_refined_frames_there_is_no_mosaic(
    result: Result, photos: dict[str, Preview]
) -> None:
    nowhere = np.full_like(result.frames.refined.center_world_m, np.nan)
    refined = replace(result.frames.refined, center_world_m=nowhere)
    unposed = replace(result, frames=replace(result.frames, refined=refined))

    assert texture_of(result, {}) is None
    assert texture_of(unposed, photos) is None


def test_a_frame_that_shows_all_of_a_cell_goes_before_one_that_shows_some() -> None:
    result = synthetic_survey.build(clean=True)
    poses = result.frames.refined
    cameras = Cameras(poses.center_world_m, poses.world_from_camera, result.frames.sweep)
    grid = Grid(result, -60.0, 50.0, 0.15, 64, (10, 12))
    choice = choose_frames(grid, cameras)
    row, column = np.meshgrid(np.arange(11.0) * 64, np.arange(13.0) * 64, indexing="ij")
    world = grid.world(column, row)
    seen = np.array(
        [
            np.isfinite(grid.pixels_in(cameras, f, world)[..., 0])
            for f in range(len(poses.center_world_m))
        ]
    )
    whole = seen[:, :-1, :-1] & seen[:, 1:, :-1] & seen[:, :-1, 1:] & seen[:, 1:, 1:]
    i, j = np.nonzero(whole.any(axis=0))

    assert len(i) > 20
    assert whole[choice[i, j], i, j].all()
    # what only a part of some photo shows is shown too
    assert ((choice >= 0) & ~whole.any(axis=0)).any()


def test_of_a_large_survey_each_cell_is_looked_at_by_the_frames_about_it_only() -> None:
    result = synthetic_survey.build(clean=True)
    poses = result.frames.refined
    forward = np.array([[1.0, 0, 0], [0, 0.6, 0.8], [0, -0.8, 0.6]])  # by 53 degrees: to the limit
    turned = poses.world_from_camera @ forward
    everywhere = Cameras(poses.center_world_m, turned, result.frames.sweep)
    for grid in (
        Grid(result, -60.0, 50.0, 0.15, 64, (10, 12)),
        Grid(result, -600.0, 500.0, 0.15, 64, (100, 120)),
    ):
        edges = [np.arange(n + 1.0) * grid.cell_px for n in grid.shape]
        row, column = np.meshgrid(*edges, indexing="ij")
        world = grid.world(column, row)
        boxes = find_boxes_below(grid, everywhere)
        for frame, box in enumerate(boxes):
            seen = np.isfinite(grid.pixels_in(everywhere, frame, world)[..., 0])
            within = np.zeros_like(seen)
            within[box.top : box.bottom + 1, box.left : box.right + 1] = True
            assert seen.any()
            assert not (seen & ~within).any()
    assert sum((b.bottom - b.top) * (b.right - b.left) for b in boxes) < 0.2 * 12_000 * len(boxes)


def test_photos_that_show_nothing_together_keep_their_brightness() -> None:
    place, grey = np.arange(20), np.full(20, 5.0)
    seen = {
        2: Light(place, grey),
        0: Light(place + 15, grey + 0.2),
        5: Light(place + 4, grey + 0.1),
    }
    empty = {4: Light(np.zeros(0, np.int64), np.zeros(0))}

    gains = estimate_gains(seen | empty, 7)

    # 2 and 5 show 16 places together, 0 and 5 nine: too few
    pair = np.linalg.solve([[17.0, -16.0], [-16.0, 17.0]], [1.6, -1.6])
    np.testing.assert_allclose(gains, np.exp([0, 0, pair[0], 0, 0, pair[1], 0]), rtol=1e-12)
    np.testing.assert_array_equal(estimate_gains(empty, 2), 1.0)
    many = estimate_gains(seen | empty, DENSE_PHOTOS + 7)  # solved in another way
    np.testing.assert_allclose(many, np.append(gains, np.ones(DENSE_PHOTOS)), rtol=1e-12)


def test_a_mosaic_much_coarser_than_the_photos_does_not_flicker() -> None:
    result = synthetic_survey.build(clean=True)
    noise = np.random.default_rng(5)
    photos = previews(result, paint=lambda _: (0, 0, 0))
    made = Mosaic(result, photos, SCALE, 60)
    for name in photos:
        made.add(
            name, noise.choice(np.array([0, 255], np.uint8), (1232 // SCALE, 1640 // SCALE, 3))
        )
    texture = made.texture()
    assert texture is not None

    # one pixel of it stands for dozens of black and white ones
    assert texture.rgb[texture.covered].std() < 255 / 2 / 3
    assert texture.rgb[texture.covered].mean() == pytest.approx(127.5, abs=5)


def test_hundreds_of_frames_choose_in_coarser_cells(photos: dict[str, Preview]) -> None:
    texture = ground_texture(synthetic_survey.build(frame_count=500), photos)

    assert texture.covered.any()


@pytest.mark.parametrize(("grey", "shown"), [(20, 100), (80, 128), (120, 120), (250, 250)])
def test_dark_ground_is_brightened_to_be_seen_and_says_so(grey: int, shown: int) -> None:
    result = synthetic_survey.build(clean=True)
    photos = previews(result, paint=lambda _: (grey, grey, grey))
    texture = ground_texture(result, dict(list(photos.items())[:2]))

    assert texture.tone.is_identity == (grey == shown)
    assert np.abs(texture.rgb[texture.covered].astype(float) - shown).max() <= 10


@pytest.mark.parametrize("cell", [16, 64, 256])
def test_pixels_of_cells_are_those_of_each_place(result: Result, cell: int) -> None:
    rows = np.flatnonzero(result.has_refined)[:1]
    poses = result.frames.refined
    sweep = np.array([[0.3, -0.2, 0.1, 0.004, -0.006, 0.003]])  # its rows are read one by one
    cameras = Cameras(poses.center_world_m[rows], poses.world_from_camera[rows], sweep)
    east, north = cameras.center_m[0, :2]
    grid = Grid(result, float(east) - 30.0, float(north) + 30.0, 0.05, cell, (1200 // cell,) * 2)
    everywhere = Box(0, grid.shape[0], 0, grid.shape[1])
    some = Box(1, grid.shape[0], 1, grid.shape[1] - 1)
    seen = grid.places_about(cameras, 0, everywhere)

    found = [grid.pixels_at(cameras, seen, box) for box in (everywhere, some)]

    row, column = (np.arange(count * cell) + 0.5 for count in grid.shape)
    world = grid.world(*np.meshgrid(column, row))
    exact, anywhere = grid.pixels_in(cameras, 0, world), grid._project_points(cameras, 0, world)
    last = [result.camera.width_px - 1, result.camera.height_px - 1]
    at_edge = np.minimum(np.abs(anywhere), np.abs(anywhere - last)).min(axis=-1) < 0.02
    assert 0.1 < np.isfinite(exact).mean() < 0.9
    for box, (u, v) in zip((everywhere, some), found, strict=True):
        part = box.pixels(cell)
        shows = np.isfinite(u)
        assert (at_edge[part] | (shows == np.isfinite(exact[part][..., 0]))).all()
        np.testing.assert_allclose(np.stack([u, v], -1)[shows], anywhere[part][shows], atol=0.02)


def test_no_pixel_of_a_photo_is_asked_for_where_it_shows_no_ground() -> None:
    sampled = mosaic._Sampled([np.full((20, 30, 3), 90, np.uint8)], 1, np.array([30.0, 20.0]))
    nowhere = np.zeros((0, 1))

    assert sampled.at(nowhere, nowhere).shape == (0, 1, 3)
