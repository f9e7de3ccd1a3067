"""Two labels swapped in one photo of a flight: named, with the edit that puts them right."""

from __future__ import annotations

from pathlib import Path

from csv_rows import read_rows, write_rows
from flight_projects import copy_project

import uavgram


def test_labels_swapped_in_a_photo_are_no_heights_of_many_points(
    data_dir: Path, tmp_path: Path
) -> None:
    """Free heights of nine points explain 99 % of what two swapped labels do here, and not all."""
    source, other = data_dir / "wind_oblique", {"P7": "R7", "R7": "P7"}
    rows = read_rows(source / "picks.csv")
    for row in rows:
        if row["image"] == "IMG_0033.jpg":
            row["label"] = other.get(row["label"], row["label"])
    write_rows(tmp_path / "picks.csv", rows)
    result = uavgram.run(copy_project(source, tmp_path, picks="picks.csv"), output=None)

    first = result.verdict.reasons[0]
    assert (first.cause, set(first.labels)) == ("labels-swapped", set(other))
    assert first.mend is not None
    swap = [one for one in first.mend.corrections if one.action == "swap"]
    assert [(one.frame, {one.label, one.other}) for one in swap] == [("IMG_0033.jpg", set(other))]
