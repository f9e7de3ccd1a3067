"""The frames and the ground points."""

from __future__ import annotations

import numpy as np

from uavgram.model.result.result import Result
from uavgram.views.report.rows import Row
from uavgram.views.wording import FRAME_STATUS_WORDS, axes_text, number, utc


def frame_rows(result: Result) -> list[Row]:
    """One row for each photo."""
    frames, image = result.frames, np.array(result.picks.image, dtype=str)
    names, counts = np.unique(image, return_counts=True)
    picks = dict(zip(names.tolist(), counts.tolist(), strict=True))
    table = []
    for i, name in enumerate(frames.frame_id):
        sigma = np.sqrt(np.diagonal(frames.refined.covariance[i]))
        table.append(
            Row(
                name=name,
                time=utc(float(frames.time_utc_s[i])),
                status=FRAME_STATUS_WORDS[frames.status[i]],
                reason=frames.reason[i],
                picks=str(picks.get(name, 0)),
                height=number(frames.refined.center_world_m[i, 2], 2),
                position=number(float(sigma[:3].max()), 2),
                attitude=number(float(np.degrees(sigma[3:].max())), 2),
                bad=frames.status[i] in ("rejected", "unmatched"),
            )
        )
    return table


def point_rows(result: Result) -> list[Row]:
    """One row for each ground point."""
    points = result.points
    return [
        Row(
            label=points.label[k],
            position=", ".join(number(x) for x in points.position_world_m[k]),
            geodetic=(
                f"{points.latitude_deg[k]:.8f}, {points.longitude_deg[k]:.8f}"
                if np.isfinite(points.latitude_deg[k])
                else "–"
            ),
            within=axes_text(points.relative.ellipse_95_m[k]),
            azimuth=f"{np.degrees(points.relative.ellipse_azimuth_rad[k]):.0f}°",
            on_earth=axes_text(points.ellipse_95_m[k]),
            frames=str(len(points.frames[k])),
        )
        for k in range(len(points.label))
    ]
