"""Finds as rows of picks.csv, and removal of the rows that they replace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.survey.observations import Picks, Source
from uavgram.stages.match import Found, Pair


def with_found(picks: Picks, found: Mapping[Pair, Found], keep: Bools | None = None) -> Picks:
    """Append finds to picks.

    Parameters
    ----------
    picks
        All picks.
    found
        By photo and label, each from one of these picks.
    keep
        (P,) picks that stay; by default all.
    """
    every = np.ones(len(picks.image), np.bool_) if keep is None else keep
    rows: list[int] = np.flatnonzero(every).tolist()
    pairs, news = list(found), list(found.values())
    origin = [one.pick for one in news]
    unknown = np.full(len(news), np.nan)
    match: Source = "match"
    return Picks(
        image=(*_some(picks.image, rows), *(image for image, _ in pairs)),
        label=(*_some(picks.label, rows), *(label for _, label in pairs)),
        pixel_px=np.concatenate([picks.pixel_px[rows], _pixels([n.pixel_px for n in news])]),
        sigma_px=np.concatenate([picks.sigma_px[rows], [one.sigma_px for one in news]]),
        height_m=np.concatenate([picks.height_m[rows], unknown]),
        height_sigma_m=np.concatenate([picks.height_sigma_m[rows], unknown]),
        is_free=np.concatenate([picks.is_free[rows], np.zeros(len(news), np.bool_)]),
        area=(*_some(picks.area, rows), *("" for _ in news)) if picks.area else (),
        source=(*(picks.source_of(i) for i in rows), *(match for _ in news)),
        score=np.concatenate([picks.score[rows], [one.score for one in news]]),
        from_image=(
            *_some(picks.from_image, rows),
            *(picks.image[i] for i in origin),
        ),
        from_px=np.concatenate([picks.from_px[rows], picks.pixel_px[origin].reshape(-1, 2)]),
    )


def _some(texts: Sequence[str], rows: Sequence[int]) -> list[str]:
    return [texts[i] for i in rows] if texts else [""] * len(rows)


def _pixels(pixels: Sequence[tuple[float, float]]) -> Floats:
    return np.array(pixels, dtype=np.float64).reshape(-1, 2)
