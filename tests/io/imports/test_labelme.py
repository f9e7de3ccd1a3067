"""LabelMe's files: turned photos judged by Pillow's own turning."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageOps

from uavgram.errors import InputError
from uavgram.io.imports import read_labelme

SIZE = (60, 40)  # stored
SPOT = (41, 7)  # stored column and row of the only white pixel


def photo(folder: Path, orientation: int) -> tuple[tuple[int, ...], tuple[float, float]]:
    pixels = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    pixels[SPOT[1], SPOT[0]] = 255
    image = Image.fromarray(pixels)
    exif = image.getexif()
    exif[0x0112] = orientation
    image.save(folder / "a.png", exif=exif)
    shown = np.asarray(ImageOps.exif_transpose(Image.open(folder / "a.png")))
    row, column = np.argwhere(shown == 255)[0]
    return shown.shape[::-1], (column + 0.5, row + 0.5)  # LabelMe counts from the corner


def labelme(
    folder: Path, size: tuple[int, ...], shapes: list[dict[str, object]], name: str = "a.json"
) -> Path:
    content = {
        "version": "5.4.1",
        "imagePath": "a.png",
        "imageWidth": size[0],
        "imageHeight": size[1],
        "shapes": shapes,
    }
    (folder / name).write_text(json.dumps(content), encoding="utf-8")
    return folder / name


def shape(label: str, *points: tuple[float, float], kind: str = "point") -> dict[str, object]:
    return {"label": label, "points": [list(map(float, p)) for p in points], "shape_type": kind}


@pytest.mark.parametrize("orientation", range(1, 9))
def test_picks_in_a_turned_photo_come_back_to_the_stored_pixel(
    tmp_path: Path, orientation: int
) -> None:
    size, spot = photo(tmp_path, orientation)
    picks = read_labelme(labelme(tmp_path, size, [shape("P", spot)]))

    np.testing.assert_allclose(picks.pixel_px, [SPOT], atol=1e-12)
    assert picks.image == ("a.png",)
    assert picks.messages == ()


def test_an_old_file_made_on_the_stored_photo_is_taken_as_it_is(tmp_path: Path) -> None:
    photo(tmp_path, 6)
    spot = (SPOT[0] + 0.5, SPOT[1] + 0.5)
    picks = read_labelme(labelme(tmp_path, SIZE, [shape("P", spot)]))

    np.testing.assert_allclose(picks.pixel_px, [SPOT], atol=1e-12)


def test_a_circle_is_picked_at_its_centre_and_other_shapes_are_named(tmp_path: Path) -> None:
    photo(tmp_path, 1)
    shapes = [
        shape("disc", (10.5, 20.5), (14, 20), kind="circle"),
        shape("car", (1, 1), (2, 2), (3, 1), kind="polygon"),
    ]
    picks = read_labelme(labelme(tmp_path, SIZE, shapes))

    np.testing.assert_allclose(picks.pixel_px, [[10.0, 20.0]])
    assert picks.label == ("disc",)
    assert "car" in picks.messages[0].text


def test_a_photo_of_another_size_is_refused_by_name(tmp_path: Path) -> None:
    photo(tmp_path, 1)
    with pytest.raises(InputError, match=r"a\.json.*30 x 20.*a\.png.*60 x 40"):
        read_labelme(labelme(tmp_path, (30, 20), [shape("P", (3, 3))]))


def test_without_the_photo_a_warning_says_what_was_not_checked(tmp_path: Path) -> None:
    picks = read_labelme(labelme(tmp_path, SIZE, [shape("P", (3.5, 4.5))]))

    assert picks.messages[0].code == "photo-not-beside"
    np.testing.assert_allclose(picks.pixel_px, [[3.0, 4.0]])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "no LabelMe file"),
        ("[]", "no LabelMe file"),
        ('{"imagePath": "a.png", "shapes": [{"label": "P", "points": []}]}', "no LabelMe file"),
        (
            '{"imagePath": "a.png", "shapes": [{"label": "P", "points": [[NaN, 1]]}]}',
            "no LabelMe file",
        ),
        ('{"imagePath": "a.png", "shapes": []}', "nothing to import"),
        (
            '{"imagePath": "a.png", "imageWidth": 60, "imageHeight": 40,'
            ' "shapes": [{"label": "P", "points": [[1e300, 1]], "shape_type": "point"}]}',
            "'P' is outside the photo",
        ),
        (
            '{"imagePath": "a.png", "shapes":'
            ' [{"label": "P\\u0007", "points": [[1, 1]], "shape_type": "point"}]}',
            "no label can have",
        ),
    ],
)
def test_a_file_that_is_none_is_told_by_name(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "x.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"x\.json.*{said}"):
        read_labelme(tmp_path / "x.json")


def test_a_label_picked_twice_is_refused(tmp_path: Path) -> None:
    photo(tmp_path, 1)
    with pytest.raises(InputError, match="'P' is picked twice"):
        read_labelme(labelme(tmp_path, SIZE, [shape("P", (3, 3)), shape("P", (9, 3))]))


def test_a_file_as_labelme_writes_it_is_read(tmp_path: Path) -> None:
    """Keys as LabelMe 5 saves them, with those that mean nothing here, and a folder in the path."""
    photo(tmp_path, 1)
    (tmp_path / "json").mkdir()
    point = shape("P", (12.25, 8.75)) | {
        "group_id": None, "description": "", "flags": {}, "mask": None,
    }  # fmt: skip
    content: dict[str, object] = {
        "version": "5.5.0", "flags": {}, "shapes": [point], "imagePath": "..\\a.png",
        "imageData": None, "imageHeight": SIZE[1], "imageWidth": SIZE[0],
    }  # fmt: skip
    (tmp_path / "json" / "a.json").write_text(json.dumps(content), encoding="utf-8")

    picks = read_labelme(tmp_path / "json" / "a.json")

    assert picks.image == ("a.png",)
    assert picks.messages == ()
    np.testing.assert_allclose(picks.pixel_px, [[11.75, 8.25]])
