"""Tables that are too long for a page: what is left out is told, and is not what matters."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic_survey as survey

from uavgram.views import result_tables
from uavgram.views.report import render_annex


def test_a_long_table_tells_what_is_doubtful_and_how_much_more_there_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = survey.build()
    whole = render_annex(made)
    assert " more photos are in results.json" not in whole
    monkeypatch.setattr(result_tables, "MAX_ROWS", 4)
    page = render_annex(made)

    photos = page.split('id="photos"')[1].split("</section>")[0]
    lost = {
        name
        for name, status in zip(made.frames.frame_id, made.frames.status, strict=True)
        if status in ("rejected", "unmatched")
    }
    assert lost
    assert all(name in photos for name in lost)
    assert photos.count("<tr") == 1 + 4
    assert f"{len(made.frames.frame_id) - 4} more photos are in results.json" in photos
    points = page.split('id="points"')[1].split("</section>")[0]
    size = made.points.relative.ellipse_95_m[:, 0]
    for k, label in enumerate(made.points.label):
        assert (f"<td>{label}</td>" in points) == (k in np.argsort(-size, kind="stable")[:4])
    assert f"{len(size) - 4} more points are in results.json" in points
    residuals = page.split("Residuals by photo")[1].split("</section>")[0]
    used = [status in ("used", "suspect") for status in made.picks.status]
    length = np.linalg.norm(made.picks.residual_px, axis=1)
    worst = made.picks.image[int(np.argmax(np.where(used, length, -1.0)))]
    assert f"<td>{worst}</td>" in residuals
    assert "These photos have the largest residuals" in residuals
