"""A photo whose picks are nonsense is left out by name, and the survey goes on without it."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from flight_projects import copy_project

import uavgram


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write(path: Path, rows: list[dict[str, str]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


def test_labels_swapped_in_a_photo_are_no_heights_of_many_points(
    data_dir: Path, tmp_path: Path
) -> None:
    """Free heights of nine points explain 99 % of what two swapped labels do here, and not all."""
    source, other = data_dir / "wind_oblique", {"P7": "R7", "R7": "P7"}
    rows = rows_of(source / "picks.csv")
    for row in rows:
        if row["image"] == "IMG_0033.jpg":
            row["label"] = other.get(row["label"], row["label"])
    write(tmp_path / "picks.csv", rows)
    result = uavgram.run(copy_project(source, tmp_path, picks="picks.csv"), output=None)

    first = result.verdict.reasons[0]
    assert (first.cause, set(first.labels)) == ("labels-swapped", set(other))
    assert first.mend is not None
    swap = [one for one in first.mend.corrections if one.action == "swap"]
    assert [(one.frame, {one.label, one.other}) for one in swap] == [("IMG_0033.jpg", set(other))]


@pytest.mark.parametrize("log", [True, False], ids=["log", "no log"])
def test_its_status_is_rejected_with_reason_and_message(
    data_dir: Path, tmp_path: Path, *, log: bool
) -> None:
    source = data_dir / "calm_nadir"
    rows = rows_of(source / "picks.csv")
    names, counts = np.unique([row["image"] for row in rows], return_counts=True)
    chosen = names[np.argsort(-counts, kind="stable")[:5]].tolist()
    rows = [row for row in rows if row["image"] in chosen]
    bad = chosen[2]
    rng = np.random.default_rng(0)
    for row in rows:
        if row["image"] == bad:
            row["u_px"], row["v_px"] = (f"{value:.1f}" for value in rng.uniform(300, 1500, 2))
    write(tmp_path / "picks.csv", rows)
    without = {} if log else {"log": None, "time": None}
    project = copy_project(source, tmp_path, picks="picks.csv", **without)
    result = uavgram.run(project, output=None)

    frames = dict(zip(result.frames.frame_id, result.frames.status, strict=True))
    reasons = dict(zip(result.frames.frame_id, result.frames.reason, strict=True))
    assert frames[bad] == "rejected"
    # With a log its picks have places, which nothing else shares; without, it may find no pose.
    why = ("labels in disorder",) if log else ("labels in disorder", "one camera could see them")
    assert any(words in reasons[bad] for words in why)
    assert [name for name in chosen if frames[name] == "refined"] == [
        name for name in chosen if name != bad
    ]
    (told,) = [m for m in result.messages if m.code == "frame-left-out"]
    assert repr(bad) in told.text
    assert result.solution.converged
    assert result.solution.chi2_probability > 1e-3
