"""How bright pictures are shown, against numpy's and OpenCV's own ways."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.imaging.photos.preview import Pixels, decode_preview, read_preview
from uavgram.imaging.photos.tone import (
    IDENTITY_TONE,
    MAX_GAIN,
    Tone,
    apply_tone,
    choose_full_range_tone,
    choose_tone,
    compute_tone_curve,
)


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
