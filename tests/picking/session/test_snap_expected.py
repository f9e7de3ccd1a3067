"""Snapping where a label is expected: wherever the pointer is, the target there is taken."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from open_projects import opened

from uavgram.picking.protocol.parse import parse_message
from uavgram.picking.session.project import OpenProject

PHOTO, LABEL = "IMG_0046.jpg", "P2"
FAR = {"u_px": 200.0, "v_px": 200.0}


@pytest.fixture
def survey(data_dir: Path, tmp_path: Path) -> tuple[Path, tuple[float, float]]:
    """A survey whose targets are picked but for one in one photo, and where that is."""
    leave = shutil.ignore_patterns("out", "*.tlog", "measure.csv")
    shutil.copytree(data_dir / "calm_nadir", tmp_path / "survey", ignore=leave)
    (tmp_path / "survey" / "measure.csv").write_text("name,kind,points\n")
    table = tmp_path / "survey" / "picks.csv"
    rows = table.read_text().splitlines(keepends=True)
    gone = next(row for row in rows if row.startswith(f"{PHOTO},{LABEL},"))
    table.write_text("".join(row for row in rows if row is not gone))
    u, v = (float(cell) for cell in gone.split(",")[2:4])
    return tmp_path / "survey" / "project.yaml", (u, v)


def snapped(project: OpenProject, **fields: object) -> Mapping[str, Any]:
    asked = {"seq": 1, "t": "snap", "image": project.picking.index[PHOTO], "target": "target"}
    text = json.dumps({**asked, **fields})
    return project.picking.answer(parse_message(text, project.picking.photos))


def test_the_target_where_the_label_is_expected_is_taken(
    survey: tuple[Path, tuple[float, float]],
) -> None:
    path, (u, v) = survey
    with opened(path) as (project, _):
        project.open()
        until = time.monotonic() + 60.0
        while project.picking.initial_state()["live"] is None:
            assert time.monotonic() < until
            time.sleep(0.02)
        found = snapped(project, **FAR, expected=LABEL)
        assert found["u_px"] == pytest.approx(u, abs=3.0)  # the pick itself has noise of 0.8 px
        assert found["v_px"] == pytest.approx(v, abs=3.0)
        assert "why" in snapped(project, **FAR)
        # Where the label is picked, or nothing is known of it, the pointer says where.
        assert "why" in snapped(project, **FAR, expected="R1")
        assert "why" in snapped(project, **FAR, expected="nobody's")
        project.picking.stop()
