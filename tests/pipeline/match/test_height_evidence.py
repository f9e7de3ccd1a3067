"""What photos show of heights includes the finds of earlier searches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from textured_ground import LABELS, write_textured

from uavgram.pipeline.match import search
from uavgram.pipeline.match.run import match_picks
from uavgram.stages.match import HeightEvidence, shows_ground


def test_a_second_search_knows_what_the_first_one_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[HeightEvidence] = []

    def kept(evidence: HeightEvidence, odds: float) -> bool:
        seen.append(evidence)
        return shows_ground(evidence, odds)

    monkeypatch.setattr(search, "shows_ground", kept)
    project = write_textured(tmp_path)

    match_picks(project.path)
    match_picks(project.path)

    first, second = seen
    assert sorted(first.label) == sorted(second.label) == sorted([*LABELS, *LABELS])
    assert np.isfinite(second.off_px).all()
