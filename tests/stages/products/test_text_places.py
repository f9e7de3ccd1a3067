"""Places of texts: rectangles that don't cover each other."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from uavgram.model.arrays import Floats
from uavgram.stages.products.text_places import Label, TextPlaces, Where, overlaps, place_labels


def common_area(one: Floats, other: Floats) -> float:
    """OpenCV's area of the intersection."""
    corners = []
    for x, y, width, height, turn in (one, other):
        box = (x, y), (2 * width, 2 * height), float(np.degrees(turn))
        corners.append(cv2.boxPoints(box))
    return float(cv2.intersectConvexConvex(corners[0], corners[1])[0])


def random_places(rng: np.random.Generator, count: int) -> Floats:
    half = rng.uniform(0.1, 1.5, (count, 2))
    return np.column_stack([rng.normal(size=(count, 2)) * 2, half, rng.uniform(-7, 7, count)])


@pytest.mark.parametrize("seed", range(5))
def test_rectangles_overlap_where_opencv_finds_a_common_area(seed: int) -> None:
    places = random_places(np.random.default_rng(seed), 60)
    found = overlaps(places[:30], places[30:])
    area = np.array([[common_area(a, b) for b in places[30:]] for a in places[:30]])

    clear = (area > 1e-4) | (area == 0)
    assert clear.mean() > 0.99
    np.testing.assert_array_equal(found[clear], (area > 0)[clear])
    assert 0.1 < found.mean() < 0.9


def crowd(rng: np.random.Generator, count: int) -> list[Label]:
    """Names of points and of lines, level and turned, much of it close together."""
    labels = []
    for row in range(count):
        start = rng.normal(size=2) * rng.choice([0.3, 30.0])
        end = start + rng.normal(size=2) * 10.0 ** rng.uniform(-2, 1.5)
        half = np.array([rng.uniform(1.0, 6.0), 0.8])
        kind = row % 3
        labels.append(
            Label(start, start if kind == 0 else end, half, 0.5, "along" if kind == 1 else "beside")
        )
    return labels


def apart(label: Label, box: Floats) -> float:
    """From a text to the nearest point of what it names."""
    line = label.start + np.linspace(0.0, 1.0, 2001)[:, None] * (label.end - label.start)
    cos, sin = np.cos(box[4]), np.sin(box[4])
    own = (line - box[:2]) @ np.array([[cos, -sin], [sin, cos]])
    return float(np.linalg.norm(np.maximum(np.abs(own) - box[2:4], 0.0), axis=1).min())


@pytest.mark.parametrize("seed", range(4))
def test_no_text_covers_another_none_is_missing_and_none_is_far(seed: int) -> None:
    labels = crowd(np.random.default_rng(seed), 150)
    boxes, _, _, size = place_labels(labels)

    assert np.isfinite(boxes).all()
    assert not (overlaps(boxes, boxes) & ~np.eye(len(boxes), dtype=bool)).any()
    heights = [apart(one, box) / (2 * box[3]) for one, box in zip(labels, boxes, strict=True)]
    assert max(heights) < 8.0
    np.testing.assert_allclose(boxes[:, 2:4], size * np.array([one.half for one in labels]))


def test_letters_are_as_large_as_they_can_be_where_there_is_room() -> None:
    half = np.array([2.0, 0.5])
    labels = [
        Label(np.array([9.0 * k, 0.0]), np.array([9.0 * k, 0.0]), half, 0.1) for k in range(9)
    ]
    boxes, leaders, _, size = place_labels(labels)

    assert size == 1.0
    np.testing.assert_allclose(np.linalg.norm(boxes[:, :2] - boxes[0, :2], axis=1)[1], 9.0)
    assert np.isnan(leaders).all()


def test_a_line_leads_to_a_text_that_is_not_beside_its_point() -> None:
    point, half = np.array([3.0, -2.0]), np.array([2.0, 0.5])
    labels = [Label(point, point, half, 0.1) for _ in range(40)]
    boxes, leaders, sides, _ = place_labels(labels, reach=10.0)
    has_line = np.isfinite(leaders[:, 0, 0])

    assert 0 < (~has_line).sum() < 20
    for line, box, side in zip(leaders[has_line], boxes[has_line], sides[has_line], strict=True):
        np.testing.assert_array_equal(line[0], point)
        end = (line[1] - box[:2]) / box[2:4]
        if side:  # in the middle of the side that faces the point
            np.testing.assert_allclose(end, [side, 0.0], atol=1e-9)
            assert side == np.sign(point[0] - box[0])
        else:  # above or below letters
            assert abs(end[1]) == pytest.approx(1.0)
            assert abs(end[0]) <= 0.7 + 1e-9


def test_what_is_taken_and_what_is_off_the_sheet_stays_free() -> None:
    taken = np.array([[0.0, -100.0, 100.0, 100.0, 0.0]])
    point, half = np.zeros(2), np.array([1.0, 0.5])
    sheet = np.array([-4.0, -50.0]), np.array([30.0, 9.0])
    labels = [Label(point, point, half, 0.1) for _ in range(20)]
    boxes = place_labels(labels, taken, sheet).boxes

    assert not overlaps(boxes, taken).any()
    assert (boxes[:, :2] - boxes[:, 2:4] >= sheet[0] - 1e-9).all()
    assert (boxes[:, :2] + boxes[:, 2:4] <= sheet[1] + 1e-9).all()


def test_a_text_that_is_not_needed_takes_no_room_from_others_and_is_right_beside() -> None:
    point, half = np.zeros(2), np.array([2.0, 0.5])
    labels = [Label(point, point, half, 0.1, is_needed=k >= 30) for k in range(40)]
    boxes, _, _, size = place_labels(labels)
    alone = place_labels(labels[30:])

    np.testing.assert_array_equal(boxes[30:], alone.boxes)
    assert size == alone.size
    assert np.isnan(boxes[:30, 0]).sum() > 10


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_of_places_the_first_that_is_free_of_all_is_taken(seed: int) -> None:
    rng = np.random.default_rng(seed)
    taken = rng.uniform(-400.0, 0.0, (1, 5)) * [1, 1, -1, -1, 0]
    places = TextPlaces(taken)
    for _ in range(300):
        candidates = random_places(rng, 6) * [3, 3, 1, 1, 1] + [*rng.normal(0, 9, 2), 0, 0, 0]
        free = np.flatnonzero(~overlaps(candidates, taken).any(axis=1))
        assert places.take(candidates) == (free[0] if len(free) else None)
        taken = np.concatenate([taken, candidates[free[:1]]])
    assert 100 < len(taken) < 300


PAPER = np.zeros(2), np.array([900.0, 600.0])


def drawing(rng: np.random.Generator) -> tuple[list[Label], Floats]:
    """Names of points, level and turned names of lines, and what is drawn, on one paper."""
    middle, spread = rng.uniform(PAPER[0], PAPER[1]), rng.uniform(30.0, 400.0)
    labels: list[Label] = []
    for row in range(int(rng.integers(2, 35))):
        start = np.clip(middle + spread * rng.normal(size=2), *PAPER)
        end = np.clip(start + spread * rng.normal(size=2), *PAPER)
        where: Where = ("beside", "beside", "along")[row % 3]
        half = np.array([rng.uniform(8.0, 60.0), 7.0])
        labels.append(
            Label(start, start if row % 3 == 0 else end, half, 4.0, where, bool(row % 5), row % 2)
        )
    taken = np.column_stack(
        [rng.uniform(PAPER[0], PAPER[1], (9, 2)), rng.uniform(2.0, 25.0, (9, 2)), np.zeros(9)]
    )
    return labels, taken


@pytest.mark.parametrize("some", range(4))
def test_in_200_random_drawings_texts_are_apart_and_have_lines_to_far_objects(some: int) -> None:
    placed = 0
    for seed in range(50 * some, 50 * some + 50):
        labels, taken = drawing(np.random.default_rng(seed))
        boxes, leaders, _, size = place_labels(labels, taken, PAPER, least=0.5, reach=10.0)
        kept = np.flatnonzero(np.isfinite(boxes[:, 0]))
        placed += len(kept)
        some_boxes = boxes[kept]
        assert not np.triu(overlaps(some_boxes, some_boxes), 1).any(), seed
        assert not overlaps(some_boxes, taken).any(), seed
        for row in kept:
            away, label = apart(labels[row], boxes[row]), labels[row]
            near = size * (label.half[1] + label.gap)  # the stated distance
            has_line = np.isfinite(leaders[row, 0, 0])
            assert has_line == (away > near) or abs(away - near) < 1.0, seed
            if has_line:
                on_line, at_text = leaders[row]
                assert apart(label, np.array([*on_line, 0.0, 0.0, 0.0])) < 0.5
                assert apart(Label(at_text, at_text, label.half, 0.0), boxes[row]) < 1e-6
    assert placed > 700
