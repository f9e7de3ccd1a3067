"""Photos reduced for looking at."""

from __future__ import annotations

import struct
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.errors import InputError
from uavgram.imaging.photos.decoding import find_jpeg_frame, halve, read_pixels
from uavgram.imaging.photos.preview import (
    IDENTITY_TONE,
    LONGEST_PX,
    MAX_GAIN,
    Pixels,
    Tone,
    apply_tone,
    choose_full_range_tone,
    choose_tone,
    compute_tone_curve,
    cut_parts,
    decode_preview,
    make_preview,
    make_preview_of_decoded,
    read_preview,
    shrink_jpeg,
)
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Region, Subject


def photo(width: int, height: int, colour: tuple[int, int, int] = (1, 1, 1)) -> Pixels:
    """Well exposed RGB photo with a dark blob a quarter from the left, a third from the top."""
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    sigma = width / 60
    blob = np.exp(-((u - width / 4) ** 2 + (v - height / 3) ** 2) / (2 * sigma**2))
    ground = np.linspace(170, 240, width)[:, None]
    return np.asarray(ground - 150 * blob[..., None] * colour, dtype=np.uint8)


def write(path: Path, rgb: Pixels) -> Path:
    assert cv2.imwrite(str(path), rgb[:, :, ::-1])
    return path


def centroid(rgb: Pixels) -> Floats:
    weight = 130 - rgb[..., 0].astype(float)
    weight[weight < 0] = 0
    v, u = np.indices(weight.shape)
    place: Floats = np.array([(u * weight).sum(), (v * weight).sum()]) / weight.sum()
    return place


@pytest.mark.parametrize("suffix", ["jpg", "png"])
@pytest.mark.parametrize(
    ("width", "height", "asked"),
    [(1603, 1201, 400), (1603, 1201, 333), (803, 602, 700), (301, 202, 800)],
)
def test_the_scale_leads_back_to_original_pixels(
    tmp_path: Path, suffix: str, width: int, height: int, asked: int
) -> None:
    rgb = photo(width, height)
    preview, pixels = read_preview(write(tmp_path / f"photo.{suffix}", rgb), asked)
    small = decode_preview(preview)
    back = (centroid(small) + 0.5) * preview.scale - 0.5

    assert small.shape == pixels.shape == (preview.height_px, preview.width_px, 3)
    assert preview.width_px <= min(asked, width)
    assert preview.width_px >= 0.8 * min(asked, width)
    np.testing.assert_allclose(back, centroid(rgb), atol=0.15)


@pytest.mark.parametrize("suffix", ["jpg", "png"])
@pytest.mark.parametrize(
    ("width", "height"), [(600, 500), (1600, 1200), (1603, 1201), (3203, 2401)]
)
def test_a_photo_of_which_all_is_wanted_has_the_preview_of_any_other(
    tmp_path: Path, suffix: str, width: int, height: int
) -> None:
    path = write(tmp_path / f"photo.{suffix}", photo(width, height))
    other, reduced = read_preview(path, 400)
    preview, pixels, halves = make_preview_of_decoded(read_pixels(path), 400)

    np.testing.assert_array_equal(halves[0], cv2.imread(str(path)))
    for large, small in pairwise(halves):  # means of 2 x 2
        even = large[: large.shape[0] // 2 * 2, : large.shape[1] // 2 * 2].astype(float)
        means = even.reshape(even.shape[0] // 2, 2, -1, 2, 3).mean(axis=(1, 3))
        np.testing.assert_allclose(small[: len(means), : means.shape[1]], means, atol=0.5)
    assert (preview.scale, pixels.shape, preview.tone) == (other.scale, reduced.shape, other.tone)
    assert np.abs(pixels.astype(float) - reduced).mean() < 1.0
    assert np.abs(pixels.astype(float) - reduced).max() < 8.0


def test_colours_stay_in_their_channels(tmp_path: Path) -> None:
    preview, _ = read_preview(write(tmp_path / "photo.png", photo(400, 300, (1, 0, 0))), 200)
    red, green, blue = decode_preview(preview)[50, 50].astype(int)

    assert red < 60
    assert green > 170
    assert blue > 170


def test_the_rotation_in_exif_is_not_applied(tmp_path: Path) -> None:
    path = write(tmp_path / "photo.jpg", photo(400, 300))
    # Exif 2.32, 4.6.4: one IFD with one SHORT, tag 0x0112 (orientation) = 6: a quarter turn
    tiff = b"MM\x00*\x00\x00\x00\x08\x00\x01" + struct.pack(">HHIHHI", 0x0112, 3, 1, 6, 0, 0)
    segment = b"Exif\x00\x00" + tiff
    plain = path.read_bytes()
    header = b"\xff\xe1" + struct.pack(">H", len(segment) + 2)
    path.write_bytes(plain[:2] + header + segment + plain[2:])
    preview, _ = read_preview(path, 400)

    read = cv2.imread(str(path))
    assert read is not None
    assert read.shape[:2] == (400, 300)  # OpenCV would turn it
    assert (preview.width_px, preview.height_px) == (400, 300)


def test_the_size_in_the_header_is_that_of_the_pixels(tmp_path: Path) -> None:
    path = write(tmp_path / "photo.jpg", photo(123, 45))

    assert find_jpeg_frame(path.read_bytes()) == ((123, 45), True)
    assert find_jpeg_frame(b"\x89PNG") is None
    assert find_jpeg_frame(path.read_bytes()[:30]) is None


@pytest.mark.parametrize("content", [b"", b"no photo", b"\xff\xd8\xff\xe0\x00\x10JFIF"])
def test_a_file_that_is_no_photo_is_an_input_error_that_names_it(
    tmp_path: Path, content: bytes
) -> None:
    path = tmp_path / "photo.jpg"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"photo\.jpg: is no photo"):
        read_preview(path)


def test_a_missing_photo_is_an_input_error_that_names_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.jpg: cannot be read: No such file"):
        read_preview(tmp_path / "gone.jpg")


def test_a_real_photo_keeps_its_shape(data_dir: Path) -> None:
    preview, _ = read_preview(data_dir / "brighton_beach" / "DJI_0025.JPG", 1000)
    frame = find_jpeg_frame((data_dir / "brighton_beach" / "DJI_0025.JPG").read_bytes())
    assert frame is not None
    width, height = frame.size_px

    assert preview.width_px * preview.scale[0] == pytest.approx(width, abs=8)
    assert preview.height_px * preview.scale[1] == pytest.approx(height, abs=8)
    assert len(preview.jpeg) < 300_000


def test_a_decoded_photo_is_reduced_as_its_file_is() -> None:
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 255, (900, 1200)).astype(np.uint8)
    grey = np.asarray(cv2.GaussianBlur(noise, (0, 0), 8), np.uint8)
    preview = make_preview(grey, 400)
    assert (preview.width_px, preview.height_px) == (400, 300)
    assert preview.scale == (3.0, 3.0)
    mean = grey.reshape(300, 3, 400, 3).mean(axis=(1, 3))
    assert np.abs(decode_preview(preview)[..., 0] - mean).mean() < 2.0
    assert find_jpeg_frame(shrink_jpeg(preview.jpeg, 100)) == ((100, 75), True)
    assert find_jpeg_frame(shrink_jpeg(preview.jpeg, 1000)) == ((400, 300), True)


# How bright pictures are shown, against numpy's and OpenCV's own ways.


def picture(low: float, high: float, power: float = 1.0) -> Pixels:
    """(180, 240, 3) grey values from one to another."""
    share = np.random.default_rng(3).random((180, 240)) ** power
    return np.repeat(np.round(low + (high - low) * share).astype(np.uint8)[..., None], 3, axis=2)


WELL_EXPOSED = [(10, 245, 1.0), (60, 130, 1.0), (0, 250, 2.0), (130, 140, 1.0), (255, 255, 1.0)]
HARD_TO_SEE = [(30, 60, 1.0), (0, 90, 1.0), (0, 255, 4.0), (140, 175, 1.0), (0, 12, 1.0)]


@pytest.mark.parametrize(("low", "high", "power"), WELL_EXPOSED)
def test_what_is_well_exposed_is_shown_as_it_is(low: float, high: float, power: float) -> None:
    pixels = picture(low, high, power)
    tone = choose_tone(pixels)

    assert tone == IDENTITY_TONE
    assert apply_tone(pixels, tone) is pixels


@pytest.mark.parametrize(("low", "high", "power"), HARD_TO_SEE)
def test_what_is_dark_or_flat_is_brightened(low: float, high: float, power: float) -> None:
    pixels = picture(low, high, power)
    shown = apply_tone(pixels, choose_tone(pixels))
    before, after = (np.percentile(each, [0.5, 50, 99.5]) for each in (pixels, shown))

    assert 40 <= after[1] <= 180
    assert after[2] - after[0] >= min(2 * (before[2] - before[0]), 240)


@pytest.mark.parametrize(("low", "high"), [(30, 95), (5, 80), (40, 104)])
def test_a_dark_picture_fills_the_screen_between_numpys_percentiles(low: int, high: int) -> None:
    pixels = picture(low, high)
    tone = choose_tone(pixels)
    ends = np.percentile(pixels[..., 0], [0.5, 99.5])

    np.testing.assert_allclose([tone.black, tone.white], ends, atol=0.06)
    np.testing.assert_allclose(
        compute_tone_curve(tone)[[round(ends[0]), round(ends[1])]], [0, 255], atol=4
    )


def test_the_size_of_the_copy_that_is_looked_at_does_not_matter() -> None:
    small = np.sort(picture(30, 95), axis=1)
    large = cv2.resize(small, None, fx=5, fy=5, interpolation=cv2.INTER_NEAREST)
    tones = choose_tone(small), choose_tone(np.asarray(large, np.uint8))

    np.testing.assert_allclose(tones[0].black, tones[1].black, atol=3)
    np.testing.assert_allclose(tones[0].white, tones[1].white, atol=3)


@pytest.mark.parametrize("tone", [Tone(), Tone(33, 61, 1), Tone(-40, 400, 0.3), Tone(5, 9, 6)])
def test_the_curve_never_falls_and_is_that_of_opencv(tone: Tone) -> None:
    values = compute_tone_curve(tone).astype(int)
    if tone.gamma == 1.0:
        scale = 255.0 / (tone.white - tone.black)
        own = cv2.convertScaleAbs(  # which takes absolute values: so only what is not cut
            np.arange(256.0)[values > 0], alpha=scale, beta=-scale * tone.black
        )
        np.testing.assert_allclose(values[values > 0], np.ravel(own), atol=1)

    assert (np.diff(values) >= 0).all()
    assert values.min() >= 0
    assert values.max() <= 255


def test_noise_is_not_brightened_beyond_a_bound() -> None:
    pixels = picture(20, 24)
    tone = choose_tone(pixels)

    assert 255.0 / (tone.white - tone.black) == pytest.approx(MAX_GAIN)
    assert tone.black <= 20
    assert tone.white >= 24


def test_who_asks_for_it_gets_a_stretch_of_a_good_picture_too() -> None:
    tone = choose_full_range_tone(picture(60, 160))

    assert tone.black == pytest.approx(60, abs=2)
    assert tone.white == pytest.approx(160, abs=2)


@pytest.mark.parametrize(
    ("black", "white", "gamma"), [(5, 5, 1), (9, 3, 1), (0, 255, 0), (0, 255, 99)]
)
def test_what_is_no_curve_is_refused(black: float, white: float, gamma: float) -> None:
    with pytest.raises(ValueError, match="no curve"):
        Tone(black, white, gamma)


@pytest.mark.parametrize(("low", "high", "brightened"), [(20, 60, True), (20, 230, False)])
def test_a_preview_is_brightened_and_its_pixels_are_not(
    tmp_path: Path, low: int, high: int, *, brightened: bool
) -> None:
    path = str(tmp_path / "photo.png")
    pixels = picture(low, high)
    assert cv2.imwrite(path, pixels)
    preview, plain = read_preview(path)
    shown = decode_preview(preview)

    assert np.array_equal(plain, pixels)
    assert preview.tone.is_identity == (not brightened)
    assert (np.percentile(shown, 99) > 200) or not brightened
    if not brightened:  # byte by byte what it always was
        assert (
            preview.jpeg
            == cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 75])[1].tobytes()
        )


# Parts of a photo for a report.


WIDTH, HEIGHT = 600, 400


def region(left: int, top: int, width: int, height: int, subject: Subject = "point") -> Region:
    return Region(
        subject=subject, row=0, frame=0, left_px=left, top_px=top, width_px=width, height_px=height
    )


@pytest.fixture
def wide_photo(tmp_path: Path) -> Path:
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    pixels = np.stack([u * 255 // WIDTH, v * 255 // HEIGHT, (u + v) // 4], axis=-1)
    cv2.imwrite(str(tmp_path / "a.png"), pixels.astype(np.uint8))
    return tmp_path / "a.png"


def decoded(content: bytes) -> Floats:
    pixels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    assert pixels is not None
    return pixels.astype(np.float64)


def test_a_part_shows_the_pixels_of_the_photo_and_says_that_they_are_as_stored(
    wide_photo: Path,
) -> None:
    (picture,) = cut_parts([read_pixels(wide_photo)], IDENTITY_TONE, [region(120, 200, 90, 60)])
    wanted = decoded(wide_photo.read_bytes())[200:260, 120:210]

    assert decoded(picture.jpeg).shape == wanted.shape
    assert np.abs(decoded(picture.jpeg) - wanted).max() < 8  # JPEG
    assert (picture.shown_px, picture.stretch) == (90, None)


def test_a_large_part_is_reduced(wide_photo: Path) -> None:
    (picture,) = cut_parts([read_pixels(wide_photo)], IDENTITY_TONE, [region(0, 0, WIDTH, HEIGHT)])
    shown = decoded(picture.jpeg)

    assert picture.shown_px == shown.shape[1] == LONGEST_PX["point"]
    assert shown.shape[0] == LONGEST_PX["point"] * HEIGHT // WIDTH


def test_a_dark_photo_is_brightened_alike_in_all_parts_and_says_so(
    wide_photo: Path,
) -> None:
    dark = (decoded(wide_photo.read_bytes()) // 5).astype(np.uint8)
    parts = [region(0, 0, 60, 60), region(400, 300, 60, 60)]
    pictures = cut_parts([dark], choose_tone(dark), parts)

    assert pictures[0].stretch == pictures[1].stretch is not None
    assert decoded(pictures[1].jpeg).mean() > 2 * dark[300:360, 400:460].mean()


def test_parts_of_the_same_place_are_the_same_picture_and_each_keeps_its_own_row(
    wide_photo: Path,
) -> None:
    parts = [region(0, 0, 400, 400), region(0, 0, 400, 400, "measurement"), region(2, 0, 400, 400)]
    first, larger, higher = cut_parts([read_pixels(wide_photo)], IDENTITY_TONE, parts)
    again = cut_parts([read_pixels(wide_photo)], IDENTITY_TONE, [*parts, replace(parts[0], row=7)])

    assert again[:3] == (first, larger, higher)
    assert again[3] == replace(first, region=replace(parts[0], row=7))
    assert len({first.jpeg, larger.jpeg, higher.jpeg}) == 3


def test_a_half_that_is_there_already_is_the_one_that_is_made(wide_photo: Path) -> None:
    pixels = read_pixels(wide_photo)
    large = region(0, 0, 2 * LONGEST_PX["point"], 200)
    pixels = np.hstack([pixels, pixels])

    assert cut_parts([pixels, halve(pixels)], IDENTITY_TONE, [large]) == cut_parts(
        [pixels], IDENTITY_TONE, [large]
    )


@pytest.mark.parametrize(("left", "at_edge"), [(2, (0, 255)), (3, (128, 255))])
def test_parts_shown_at_half_size_lie_where_they_are_in_the_photo(
    left: int, at_edge: tuple[int, int]
) -> None:
    pixels = np.zeros((740, 740, 3), np.uint8)
    pixels[:, 402:] = 255

    (picture,) = cut_parts([pixels], IDENTITY_TONE, [region(left, 4, 720, 720)])

    assert picture.shown_px == 360
    assert decoded(picture.jpeg)[100, 199:201].mean(axis=1) == pytest.approx(at_edge, abs=25)
