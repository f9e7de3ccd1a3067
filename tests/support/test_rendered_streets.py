"""The rendered streets show what their truth says, measured in photos without blur and noise."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from streets.render import Renderer
from streets.street import Street, Wish, draw_street

from uavgram.model.arrays import Floats


def centroid_error(street: Street, photo: int) -> Floats:
    """(n, 2) white rings of discs in the photo, less where exact projection has them."""
    ground = replace(street.scene, bodies=())  # their shadows stay
    clear, _ = Renderer(ground, street.camera).clear(street.view[photo])
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    errors = []
    for place in street.point[[label[0] == "R" for label in street.label]]:
        rings = []
        for radius in (0.20, 0.07, 0.225):  # white within the first, black to the last
            edge = place[:2] + radius * np.column_stack([np.cos(angle), np.sin(angle)])
            pixel, seen = street.sighted(
                photo, np.column_stack([edge, street.scene.relief.up(edge)])
            )
            rings.append(pixel if seen.all() else np.zeros((0, 2)))
        if any(len(ring) == 0 for ring in rings):
            continue
        if np.linalg.norm(rings[2] - rings[0], axis=1).min() < 1.1:  # the rim fades into the ground
            continue
        low = np.floor(rings[2].min(axis=0)).astype(int) - 2
        high = np.ceil(rings[2].max(axis=0)).astype(int) + 3
        part = clear[low[1] : high[1], low[0] : high[0]] @ np.array([0.114, 0.587, 0.299], "f4")
        mask = np.zeros(part.shape, np.uint8)
        cv2.fillPoly(mask, [np.rint(rings[2] - low).astype(np.int32)], [1])
        if part[mask > 0].min() < 27:  # in a shadow
            continue
        white = (part - 30.0) * mask
        v, u = np.mgrid[low[1] : high[1], low[0] : high[0]]
        found = np.array([(white * u).sum(), (white * v).sum()]) / white.sum()
        errors.append(found - _ring_middle(rings[0], rings[1]))
    return np.array(errors)


def _ring_middle(outer: Floats, inner: Floats) -> Floats:
    """(2,) centroid of the area between two outlines (n, 2)."""
    area, first = [], []
    for path in (outer, inner):
        base = path.mean(axis=0)
        a, b = path - base, np.roll(path, -1, axis=0) - base
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        area.append(cross.sum() / 2)
        first.append((cross[:, None] * (a + b)).sum(axis=0) / 6 + area[-1] * base)
    return np.asarray((first[0] - first[1]) / (area[0] - area[1]))


def test_discs_lie_where_exact_projection_has_them() -> None:
    wish = Wish(
        kind="oblique", photos=2, height_m=10.0, readout_s=0.03, width_px=1000, height_px=750,
        natural=0, plates=0,
    )  # fmt: skip
    error = centroid_error(draw_street(6, wish), photo=1)
    assert len(error) >= 2
    assert np.abs(error).max() < 0.02
