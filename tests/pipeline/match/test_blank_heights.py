"""Corners of roofs picked without a height: found where they are, or refused; the ground is found.

Photos of a flat, textured ground from straight above, with even roofs whose edges lead along the
flight: such an edge falls on itself at any height.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
import pytest

from uavgram.cli import main
from uavgram.imaging.matching.line_of_sight import LineMatches, SightLine, match_along_line
from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats
from uavgram.pipeline.match import search
from uavgram.pipeline.match.run import match_picks
from uavgram.stages.match import Matches

SIZE = np.array([1000, 750])
MIDDLE = (SIZE - 1) / 2
FOCAL_PX, HEIGHT_M, ROOF_M = 1200.0, 40.0, 1.45
CENTERS_M = [(-4.0, 0.3), (-2.0, -0.4), (0.0, 0.0), (2.0, 0.4), (4.0, -0.3)]
SOURCE = 2
ROOFS_M = [(-7.0, 3.0), (-1.5, 4.0), (3.5, -4.5), (-3.5, -3.0)]
HALF_M = np.array([1.1, 0.7])
WRONG_SIGMAS = 5.0


def seen(place_m: Floats, photo: int) -> Floats:
    """(n, 2) pixels of places (n, 3)."""
    away = (place_m[:, :2] - CENTERS_M[photo]) / (HEIGHT_M - place_m[:, 2:])
    return MIDDLE + FOCAL_PX * away * [1.0, -1.0]


def corners(roof: tuple[float, float]) -> Floats:
    """(4, 3) of a roof, around it."""
    turns = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.column_stack([np.array(roof) + turns * HALF_M, np.full(4, ROOF_M)])


def photo(number: int, rng: np.random.Generator) -> Image:
    """A photo of the ground and the roofs."""
    grain = np.random.default_rng(4)
    side, texel = 1000, 0.04
    ground = np.full((side, side), 110.0, np.float32)
    for cells in (side // 2, side // 6, side // 18, side // 54):
        coarse = grain.normal(0, 14.0, (cells, cells)).astype(np.float32)
        ground += cv2.resize(coarse, (side, side), interpolation=cv2.INTER_CUBIC)
    scale = FOCAL_PX / HEIGHT_M * texel
    offset = seen(np.array([[-side / 2 * texel, side / 2 * texel, 0.0]]), number)[0]
    to_photo = np.array([[scale, 0, offset[0]], [0, scale, offset[1]]])
    picture = cv2.warpAffine(ground, to_photo, SIZE.tolist(), flags=cv2.INTER_CUBIC)
    for roof, shade in zip(ROOFS_M, (50.0, 190.0, 35.0, 205.0), strict=True):
        corner = np.round(seen(corners(roof), number) * 256).astype(np.int32)
        cv2.fillConvexPoly(picture, corner, shade, cv2.LINE_AA, 8)
    noisy = cv2.GaussianBlur(picture, (0, 0), 0.7) + rng.normal(0, 1.5, picture.shape)
    return np.asarray(np.clip(noisy, 0, 255), dtype=np.uint8)


@pytest.fixture(scope="module")
def points() -> dict[str, Floats]:
    rng, place = np.random.default_rng(2), dict[str, Floats]()
    while len(place) < 16:
        at = rng.uniform([-8.0, -8.0], [8.0, 8.0])
        if min(np.abs(at - roof).max() for roof in ROOFS_M) > 2.2:
            place[f"P{len(place)}"] = np.array([*at, 0.0])
    for k, roof in enumerate(ROOFS_M):
        place |= {f"V{k}{i}": corner for i, corner in enumerate(corners(roof))}
    return place


def write_project(points: dict[str, Floats], folder: Path, sources: tuple[int, ...]) -> Path:
    """A project with all points picked in some photos."""
    rng = np.random.default_rng(3)
    rows = ["image,label,u_px,v_px,height_m"]
    ground = [label for label in points if label[0] == "P"]
    for number in range(len(CENTERS_M)):
        cv2.imwrite(str(folder / f"{number}.png"), photo(number, rng))
        for label in [*ground[:6], *(points if number in sources else ())]:
            (u, v) = seen(points[label][None], number)[0]
            row = f"{number}.png,{label},{u:.3f},{v:.3f},"
            rows += [row] * (row not in rows)
    (folder / "picks.csv").write_text("\n".join(rows) + "\n")
    lengths = ["name,from,to,length_m,sigma_m"]
    for a, b in combinations(ground[:6], 2):
        lengths.append(f"{a}-{b},{a},{b},{np.linalg.norm(points[a] - points[b]):.4f},0.01")
    (folder / "lines.csv").write_text("\n".join(lengths) + "\n")
    (folder / "measure.csv").write_text("name,kind,points\n")
    (folder / "camera.yaml").write_text(
        f"name: still\nmodel: brown\nwidth_px: {SIZE[0]}\nheight_px: {SIZE[1]}\n"
        f"parameters: [{FOCAL_PX}, {FOCAL_PX}, {MIDDLE[0]}, {MIDDLE[1]}, 0, 0, 0, 0, 0]\n"
        "sigma: [1.0, 1.0, 1.0, 1.0, 0.0001, 0.0001, 0.00001, 0.00001, 0.0001]\n"
    )
    (folder / "project.yaml").write_text(
        "name: roofs\nimages: '*.png'\ncamera: camera.yaml\npicks: picks.csv\n"
        "lines: lines.csv\nmeasure: measure.csv\n"
    )
    return folder / "project.yaml"


@pytest.fixture(scope="module", params=[(SOURCE,), (SOURCE, SOURCE + 1)], ids=str)
def matches(
    request: pytest.FixtureRequest,
    points: dict[str, Floats],
    tmp_path_factory: pytest.TempPathFactory,
) -> Matches:
    project = write_project(points, tmp_path_factory.mktemp("roofs"), request.param)
    return match_picks(project, dry_run=True)


def test_corners_of_roofs_without_a_height_are_found_where_they_are_or_not_at_all(
    matches: Matches, points: dict[str, Floats]
) -> None:
    wrong = {
        (image, label): float(np.linalg.norm(off))
        for (image, label), one in matches.record.found.items()
        for off in [one.pixel_px - seen(points[label][None], int(image[0]))[0]]
        if np.linalg.norm(off) > WRONG_SIGMAS * one.sigma_px
    }
    assert wrong == {}
    assert sum(label[0] == "V" for _, label in matches.record.found) > 10


def test_points_on_the_ground_are_found_as_exactly_as_ever(
    matches: Matches, points: dict[str, Floats]
) -> None:
    found = {pair: one for pair, one in matches.record.found.items() if pair[1][0] == "P"}
    missed = [pair for pair in matches.record.in_vain if pair[1][0] == "P"]
    assert len(found) >= 0.97 * (len(found) + len(missed)) > 29
    off = [
        np.array(one.pixel_px) - seen(points[label][None], int(image[0]))[0]
        for (image, label), one in found.items()
    ]
    assert np.sqrt(np.mean(np.square(off))) < 0.1


def test_a_second_click_in_the_same_photo_is_no_other_view(
    points: dict[str, Floats], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = write_project(points, tmp_path, (SOURCE, SOURCE + 1))
    picks = tmp_path / "picks.csv"
    rows = picks.read_text().splitlines()
    again = [row for row in rows if row.startswith((f"{SOURCE}.png,V", f"{SOURCE + 1}.png,V"))]
    picks.write_text("\n".join([*rows, *again]) + "\n")
    views: list[int] = []

    def counted(source: Image, targets: Sequence[Image], line: SightLine) -> LineMatches:
        views.append(len(targets))
        return match_along_line(source, targets, line)

    monkeypatch.setattr(search, "match_along_line", counted)
    match_picks(project, dry_run=True)

    assert views
    assert max(views) == len(CENTERS_M) - 1


@pytest.mark.parametrize("height_m", ["", "0"])
def test_points_that_look_different_in_most_photos_are_found_only_where_the_ground_is_known(
    points: dict[str, Floats], tmp_path: Path, capsys: pytest.CaptureFixture[str], height_m: str
) -> None:
    ground = {label: place for label, place in points.items() if label[0] == "P"}
    project = write_project(ground, tmp_path, (0, 4))
    marks = list(ground)[:6]
    picks = tmp_path / "picks.csv"
    rows = [row + height_m * (row.split(",")[1] in marks) for row in picks.read_text().split()]
    picks.write_text("\n".join(rows) + "\n")
    project.write_text(project.read_text() + "picks_sigma_px: 0.1\n")
    rng = np.random.default_rng(5)
    for number in (2, 3):
        picture = np.asarray(cv2.imread(str(tmp_path / f"{number}.png"), cv2.IMREAD_GRAYSCALE))
        for label in set(ground) - set(marks):
            u, v = np.round(seen(ground[label][None], number)[0]).astype(int).clip(25)
            spot = picture[v - 25 : v + 25, u - 25 : u + 25]
            spot[:] = cv2.GaussianBlur(rng.integers(0, 255, spot.shape, np.uint8), (0, 0), 1.0)
        cv2.imwrite(str(tmp_path / f"{number}.png"), picture)

    status = main(["picks", "match", str(project)])

    assert status == 0
    said = capsys.readouterr().out
    found = [row for row in picks.read_text().splitlines() if ",match," in row]
    if height_m:
        assert len(found) > 5
    else:
        assert found == []
        assert "also pick three marks on the road, each in two photos" in said
