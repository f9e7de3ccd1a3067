"""Places of texts: rectangles that don't cover each other."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from uavgram.model.arrays import Floats
from uavgram.stages.products.text_places import Label, TextPlaces, leader, overlaps, place_labels


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


ENDLESS = np.empty((0, 5))


def crowd(rng: np.random.Generator, count: int) -> list[Label]:
    """Names of points and of lines, level and turned, much of it close together."""
    labels = []
    for row in range(count):
        start = rng.normal(size=2) * rng.choice([0.3, 30.0])
        end = start + rng.normal(size=2) * 10.0 ** rng.uniform(-2, 1.5)
        half = np.array([rng.uniform(1.0, 6.0), 0.8])
        kind = row % 3
        labels.append(Label(start, start if kind == 0 else end, half, 0.5, is_turned=kind == 1))
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
    boxes, size = place_labels(labels, ENDLESS)

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
    boxes, size = place_labels(labels, ENDLESS)

    assert size == 1.0
    np.testing.assert_allclose(np.linalg.norm(boxes[:, :2] - boxes[0, :2], axis=1)[1], 9.0)
    assert all(leader(one, box) is None for one, box in zip(labels, boxes, strict=True))


def test_a_line_leads_to_a_text_that_is_not_beside_its_point() -> None:
    point, half = np.array([3.0, -2.0]), np.array([2.0, 0.5])
    labels = [Label(point, point, half, 0.1) for _ in range(40)]
    boxes, _ = place_labels(labels, ENDLESS, reach=10.0)
    lines = [leader(one, box) for one, box in zip(labels, boxes, strict=True)]

    assert 0 < sum(line is None for line in lines) < 20
    for line, box in zip(lines, boxes, strict=True):
        if line is not None:
            np.testing.assert_array_equal(line[0], point)
            assert (np.abs(line[1] - box[:2]) <= box[2:4] + 1e-9).all()


def test_what_is_taken_and_what_is_off_the_sheet_stays_free() -> None:
    taken = np.array([[0.0, -100.0, 100.0, 100.0, 0.0]])
    point, half = np.zeros(2), np.array([1.0, 0.5])
    sheet = np.array([-4.0, -50.0]), np.array([30.0, 9.0])
    labels = [Label(point, point, half, 0.1) for _ in range(20)]
    boxes, _ = place_labels(labels, taken, sheet)

    assert not overlaps(boxes, taken).any()
    assert (boxes[:, :2] - boxes[:, 2:4] >= sheet[0] - 1e-9).all()
    assert (boxes[:, :2] + boxes[:, 2:4] <= sheet[1] + 1e-9).all()


def test_a_text_that_is_not_needed_takes_no_room_from_others_and_is_right_beside() -> None:
    point, half = np.zeros(2), np.array([2.0, 0.5])
    labels = [Label(point, point, half, 0.1, is_needed=k >= 30) for k in range(40)]
    boxes, size = place_labels(labels, ENDLESS)
    alone = place_labels(labels[30:], ENDLESS)

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
