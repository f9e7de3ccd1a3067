"""OpenDroneMap's ground control files; places judged by pyproj, a round trip by our own writer."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps
from pyproj import Transformer
from tagged_jpeg import placed_jpeg

from uavgram.errors import InputError
from uavgram.io.imports import GcpSigmas, read_gcp_list, read_labelme

HEAD = "EPSG:32632\n"
ROW = "691000.25 5334000.5 520.125 1539.25 1337 DSC_1.JPG A\n"


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "gcp_list.txt"
    path.write_text(text, encoding="utf-8")
    return path


def test_picks_and_places_are_those_of_the_file(tmp_path: Path) -> None:
    picks = read_gcp_list(write(tmp_path, HEAD + "# note\n" + ROW), GcpSigmas(sigma_m=0.05))

    np.testing.assert_array_equal(picks.pixel_px, [[1539.25, 1337.0]])
    assert (picks.image, picks.label) == (("DSC_1.JPG",), ("A",))
    to_map = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True)
    assert picks.known is not None
    latitude, longitude, height = picks.known.coordinates[0]
    np.testing.assert_allclose(
        to_map.transform(longitude, latitude), [691000.25, 5334000.5], atol=1e-4
    )
    assert height == 520.125
    np.testing.assert_array_equal(picks.known.sigma_m, [[0.05] * 3])


def test_without_a_stated_sigma_the_places_are_not_taken(tmp_path: Path) -> None:
    assert read_gcp_list(write(tmp_path, HEAD + ROW)).known is None


def test_points_without_a_label_are_the_same_where_their_place_is(tmp_path: Path) -> None:
    rows = "1 2 3 10 20 a.jpg\n1 2 3 30 40 b.jpg\n5 6 7 50 60 a.jpg\n"
    picks = read_gcp_list(write(tmp_path, HEAD + rows))

    assert picks.label == ("gcp-1", "gcp-1", "gcp-2")
    assert picks.messages[0].code == "gcp-without-labels"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("nonsense\n" + ROW, r":1: 'nonsense' is no coordinate system"),
        (HEAD, "a line for each pick"),
        (HEAD + "1 2 3 4 5\n", r":2: needs x, y, z"),
        (HEAD + ROW + "1 2 x 4 5 a.jpg B\n", r":3: z must be a number \(got 'x'\)"),
        (HEAD + ROW + "1 2 3 4 5 DSC_2.JPG A\n", r":3: label 'A' has another place"),
        (HEAD + "1\t2\t3\t4\t5\t\tA\n", r":2: has an empty cell, and 'A' is no name of a photo"),
        (HEAD + "1\t2\t\t4\t5\ta.jpg\tA\n", r":2: row must be a number .*: a cell .* is empty"),
        (HEAD + ROW + ROW, r":3: label 'A' is picked in 'DSC_1.JPG' in line 2 already"),
    ],
)
def test_mistakes_are_told_by_file_and_line(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(
        InputError, match=r"gcp_list\.txt" + (said if said[0] == ":" else f".*{said}")
    ):
        read_gcp_list(write(tmp_path, text))


def test_a_point_without_height_is_picked_but_is_no_control(tmp_path: Path) -> None:
    rows = "1 2 NaN 10 20 a.jpg A\n1 2 nan 30 40 b.jpg A\n5 6 7 50 60 a.jpg B\n"
    path = write(tmp_path, HEAD + rows)

    assert read_gcp_list(path).label == ("A", "A", "B")
    with pytest.raises(InputError, match=r":2: has no height \(NaN\)"):
        read_gcp_list(path, GcpSigmas(sigma_m=0.05))


def test_blanks_tabs_and_further_cells_are_no_matter(tmp_path: Path) -> None:
    rows = "1\t2\t3\t10.5  20\ta.jpg\tA\tpainted cross\r\n"
    picks = read_gcp_list(write(tmp_path, "\ufeffWGS84 UTM 32N\n\n" + rows))

    assert picks.label == ("A",)
    np.testing.assert_array_equal(picks.pixel_px, [[10.5, 20.0]])


@pytest.mark.parametrize(
    ("first", "code"),
    [
        ("PUWG1992", 2180),
        ("PUWG 1992", 2180),
        ("EPSG:2180", 2180),
        ("epsg 2180", 2180),
        ("WGS84 UTM 32N", 32632),
        ("WGS84 UTM 33S", 32733),
        ("+proj=utm +zone=32 +datum=WGS84 +units=m +no_defs", 32632),
        ("SWEREF99 TM", 3006),
    ],
)
def test_coordinate_systems_by_the_names_that_people_write(
    tmp_path: Path, first: str, code: int
) -> None:
    place = "500000 5600000" if code != 2180 else "500000 500000"
    picks = read_gcp_list(
        write(tmp_path, f"{first}\n{place} 3 10 20 a.jpg A\n"), GcpSigmas(sigma_m=1)
    )
    assert picks.known is not None
    latitude, longitude, _ = picks.known.coordinates[0]
    back = Transformer.from_crs("EPSG:4326", f"EPSG:{code}", always_xy=True)
    expected = [float(value) for value in place.split()]
    np.testing.assert_allclose(back.transform(longitude, latitude), expected, atol=1e-3)


ZERO = "1 2 0 10 20 a.jpg A\n1 3 0.0 10 30 a.jpg B\n"


def test_heights_of_0_get_no_weight_and_a_warning(tmp_path: Path) -> None:
    picks = read_gcp_list(write(tmp_path, "EPSG:4326\n" + ZERO), GcpSigmas(sigma_m=0.02))
    assert picks.known is not None
    assert picks.known.sigma_m.tolist() == [[0.02, 0.02, 10_000.0]] * 2
    assert [message.code for message in picks.messages] == ["gcp-zero-heights"]
    assert "all points have the height 0" in picks.messages[0].text

    known = read_gcp_list(
        write(tmp_path, "EPSG:4326\n" + ZERO), GcpSigmas(sigma_m=0.02, sigma_up_m=0.05)
    )
    assert known.known is not None
    assert known.known.sigma_m.tolist() == [[0.02, 0.02, 0.05]] * 2
    assert known.messages == ()


def test_points_may_have_sigmas_of_their_own(tmp_path: Path) -> None:
    rows = "1 2 5 10 20 a.jpg A 0.01 0.03\n1 3 5 10 30 a.jpg B 0.02\n1 4 5 10 40 a.jpg C\n"
    path = write(tmp_path, "EPSG:4326\n" + rows)
    picks = read_gcp_list(path, GcpSigmas(sigma_m=0.5, in_columns=True))
    assert picks.known is not None
    assert picks.known.sigma_m.tolist() == [[0.01, 0.01, 0.03], [0.02] * 3, [0.5] * 3]
    with pytest.raises(InputError, match=r":4: label 'C' has no sigma behind it"):
        read_gcp_list(path, GcpSigmas(in_columns=True))
    with pytest.raises(InputError, match=r":2: sigma behind the label 'A' must be greater than 0"):
        read_gcp_list(
            write(tmp_path, "EPSG:4326\n1 2 5 10 20 a.jpg A -1\n"), GcpSigmas(in_columns=True)
        )


@pytest.mark.parametrize("label", ["A;B", "A\u202eB"])
def test_a_label_that_no_table_can_hold_is_told(tmp_path: Path, label: str) -> None:
    with pytest.raises(InputError, match=r":2: label .* holds"):
        read_gcp_list(write(tmp_path, f"EPSG:4326\n1 2 5 10 20 a.jpg {label}\n"))


@pytest.mark.parametrize(
    ("row", "image", "label"),
    [
        ("1\t2\t3\t4\t5\tday 2 DSC 1.JPG\tnorth corner", "day 2 DSC 1.JPG", "north corner"),
        ("1\t2\t3\t4\t5\tday 2 DSC 1.JPG", "day 2 DSC 1.JPG", "gcp-1"),
        ("1\t2\t3\t4\t5\tday 2 camera 7\tA", "day 2 camera 7", "A"),
        ("1\t2\t3\t4\t5\tDSC 1.JPG A", "DSC 1.JPG", "A"),
        ("1 2 3 4 5 day 2 DSC 1.tiff A", "day 2 DSC 1.tiff", "A"),
        ("1 2 3 4 5 DSC_1 A", "DSC_1", "A"),
    ],
)
def test_names_with_blanks_are_kept_whole(tmp_path: Path, row: str, image: str, label: str) -> None:
    picks = read_gcp_list(write(tmp_path, HEAD + row + "\n"))

    assert (picks.image, picks.label) == ((image,), (label,))


def test_sigmas_behind_a_label_with_blanks_are_its_own(tmp_path: Path) -> None:
    row = "691000\t5334000\t520\t4\t5\tDSC 1.JPG\tnorth corner\t0.02\t0.04\n"
    picks = read_gcp_list(write(tmp_path, HEAD + row), GcpSigmas(in_columns=True))

    assert picks.known is not None
    np.testing.assert_array_equal(picks.known.sigma_m, [[0.02, 0.02, 0.04]])


@pytest.mark.parametrize("labels", [("", ""), (" A", " B")])
def test_one_place_at_two_heights_is_told_with_its_lines(
    tmp_path: Path, labels: tuple[str, str]
) -> None:
    rows = (
        f"1 2 939.97 10 20 a.jpg{labels[0]}\n1 2 930.18 30 40 b.jpg{labels[1]}\n5 6 7 1 1 a.jpg\n"
    )
    messages = read_gcp_list(write(tmp_path, HEAD + rows)).messages

    (said,) = [m.text for m in messages if m.code == "gcp-two-heights"]
    assert "at 939.97 (line 2) and" in said
    assert "at 930.18 (line 3)" in said


def test_a_label_at_two_heights_is_a_mistake(tmp_path: Path) -> None:
    rows = "1 2 939.97 10 20 a.jpg A\n1 2 930.18 30 40 b.jpg A\n"

    with pytest.raises(
        InputError, match=r":3: label 'A' has another height .930.18. than in line 2 .939.97."
    ):
        read_gcp_list(write(tmp_path, HEAD + rows))


@pytest.mark.parametrize("folder", [".", "images"])
@pytest.mark.parametrize(
    ("head", "first", "second"),
    [
        ("EPSG:4326", "8.55 47.3", "47.3001 8.5502"),
        ("EPSG:32632", "{0} {1}", "{1} {0}"),
        ("+proj=tmerc +lon_0=8.5 +lat_0=47.2 +y_0=1000", "{2} {3}", "{3} {2}"),  # alike in size
    ],
)
def test_exchanged_coordinates_are_told_where_photos_show_it(
    tmp_path: Path, folder: str, head: str, first: str, second: str
) -> None:
    (tmp_path / folder).mkdir(exist_ok=True)
    (tmp_path / folder / "a.jpg").write_bytes(placed_jpeg(8.54, 47.31))
    to_map = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True)
    east, north = to_map.transform(8.55, 47.3)
    alike = Transformer.from_crs("EPSG:4326", head, always_xy=True).transform(8.55, 47.3)
    rows = f"{first} 400 1 1 a.jpg A\n{second} 400 2 2 a.jpg B\n".format(east, north, *alike)
    path = write(tmp_path, f"{head}\n{rows}")

    with pytest.raises(InputError, match=r":3: .*near it with latitude and longitude .* exchanged"):
        read_gcp_list(path, GcpSigmas(sigma_m=0.05))


def test_one_sentence_tells_of_all_points_with_exchanged_coordinates(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(placed_jpeg(8.54, 47.31))
    points = "".join(f"47.30{k} 8.55{k} 400 {k} {k} a.jpg G{k}\n" for k in range(4))
    path = write(tmp_path, f"EPSG:4326\n{points}")

    with pytest.raises(InputError) as raised:
        read_gcp_list(path, GcpSigmas(sigma_m=0.05))

    told = str(raised.value)
    assert told.count("exchanged") == 1
    assert told.endswith("(also lines 3, 4, 5)")


def test_exchanged_coordinates_are_told_by_the_systems_area_where_no_photo_is_there(
    tmp_path: Path,
) -> None:
    rows = "5238000 466000 400 1 1 a.jpg A\n466000 5238000 400 2 2 a.jpg B\n"
    path = write(tmp_path, f"EPSG:32632\n{rows}")

    with pytest.raises(InputError, match=r":2: is outside WGS 84 / UTM zone 32N, and inside with"):
        read_gcp_list(path, GcpSigmas(sigma_m=0.05))


def test_degrees_in_a_system_of_metres_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path, "WGS84 UTM 33N\n16.4759 47.6435 463 10 20 a.jpg A\n")
    with pytest.raises(InputError, match=r":2: \(16.4759, 47.6435\) are degrees, .* UTM zone 33N"):
        read_gcp_list(path, GcpSigmas(sigma_m=0.05))


def test_picks_in_photos_that_are_not_there_are_left_out_and_counted(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(placed_jpeg(8.54, 47.31))
    rows = "".join(f"8.55 47.3 400 1 1 {name}.jpg A\n" for name in "abc")
    picks = read_gcp_list(write(tmp_path, f"EPSG:4326\n{rows}"))
    assert picks.image == ("a.jpg",)
    (message,) = picks.messages
    assert message.code == "gcp-photos-absent"
    assert "2 of 3 picks are left out" in message.text


def test_numbers_behind_a_label_are_told_unless_they_are_sigmas(tmp_path: Path) -> None:
    path = write(tmp_path, HEAD + "691000 5334000 520 10 20 a.JPG A 1\n")
    (told,) = read_gcp_list(path).messages
    assert told.code == "gcp-numbers-unused"
    assert "'1' behind 'A'" in told.text
    assert "separate all cells by tabs" in told.text
    assert read_gcp_list(path, GcpSigmas(in_columns=True)).messages == ()
    tabbed = write(tmp_path, HEAD + "691000\t5334000\t520\t10\t20\ta.JPG\tA 1\n")
    picks = read_gcp_list(tabbed)
    assert (picks.label, picks.messages) == (("A 1",), ())


@pytest.mark.parametrize(
    ("names", "surplus"),
    [
        ("Flug 3.JPG Punkt eins", "'eins' behind the label 'Punkt'"),
        ('"my photo 1.JPG" "G 1"', "behind the label 'photo'"),
        ("photo two.webp G1", "'G1' behind the label 'two.webp'"),
    ],
)
def test_a_name_with_blanks_is_never_cut(tmp_path: Path, names: str, surplus: str) -> None:
    with pytest.raises(InputError) as refused:
        read_gcp_list(write(tmp_path, HEAD + f"1 2 3 10 20 {names}\n"))
    assert surplus in str(refused.value)
    assert "separate all cells by tabs" in str(refused.value)


@pytest.mark.parametrize(
    "row",
    [
        "1,2,3,10.5,20,DSC 1.JPG,north corner",
        "1, 2, 3, 10.5, 20, DSC 1.JPG, north corner",
        "1;2;3;10,5;20;DSC 1.JPG;north corner",
    ],
)
def test_cells_may_be_separated_by_commas_or_semicolons(tmp_path: Path, row: str) -> None:
    picks = read_gcp_list(write(tmp_path, f"{HEAD}{row}\n{row.replace('3', 'NaN', 1)} 2\n"))

    assert picks.image == ("DSC 1.JPG",) * 2
    assert picks.label == ("north corner", "north corner 2")
    np.testing.assert_array_equal(picks.pixel_px, [[10.5, 20.0]] * 2)


def test_decimal_commas_between_blanks_are_no_separators(tmp_path: Path) -> None:
    row = "691000,25 5334000,5 520,25 10,5 20,5 a.jpg A\n"

    np.testing.assert_array_equal(
        read_gcp_list(write(tmp_path, HEAD + row)).pixel_px, [[10.5, 20.5]]
    )


@pytest.mark.parametrize("code", ["utf-16", "utf-16-le", "utf-16-be"])
def test_utf_16_is_named(tmp_path: Path, code: str) -> None:
    path = tmp_path / "gcp_list.txt"
    path.write_text(HEAD + ROW, encoding=code)

    with pytest.raises(InputError, match=r":1: is UTF-16 text .*: save it as UTF-8"):
        read_gcp_list(path)


@pytest.mark.parametrize(
    ("pixel", "photo"),
    [("-5 20", False), ("1e9 20", False), ("20 70000", False), ("-5 20", True), ("20 64", True)],
)
def test_a_pixel_outside_of_its_photo_is_told_with_its_line(
    tmp_path: Path, pixel: str, *, photo: bool
) -> None:
    if photo:
        cv2.imwrite(str(tmp_path / "a.jpg"), np.zeros((64, 96, 3), np.uint8))
    path = write(tmp_path, f"{HEAD}1 2 3 95 63 a.jpg A\n1 3 3 {pixel} a.jpg B\n")

    with pytest.raises(
        InputError, match=r":3: the pick of 'B' at .* is outside 'a.jpg'"
    ) as refused:
        read_gcp_list(path)
    assert ("96 x 64 px" in str(refused.value)) == photo


@pytest.mark.parametrize("mark", [";", "\t", " "])
def test_a_comma_that_may_be_of_thousands_is_asked_about(tmp_path: Path, mark: str) -> None:
    row = mark.join(("316675,449", "7405032,799", "939,968", "1560,86", "294,55", "a.JPG", "G1"))

    with pytest.raises(InputError, match=r":2: z must be .*: is it 939\.968 or 939968\?"):
        read_gcp_list(write(tmp_path, f"{HEAD}{row}\n"))


def test_a_file_in_another_encoding_is_to_be_saved_as_utf_8(tmp_path: Path) -> None:
    path = tmp_path / "gcp_list.txt"
    path.write_bytes((HEAD + ROW.replace("DSC", "Stra\u00dfe")).encode("latin-1"))

    with pytest.raises(InputError, match=r":2: is not UTF-8 text: save it as UTF-8"):
        read_gcp_list(path)


# LabelMe's files: turned photos judged by Pillow's own turning.


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
