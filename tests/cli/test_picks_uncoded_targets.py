"""`uavgram picks targets` for targets without a number, on three small photos of one texture."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from small_projects import Command
from textured_ground import NAMES, Textured, write_textured

SHIFT = 4


def test_a_disc_that_is_picked_once_is_measured_in_the_other_photos(
    tmp_path: Path, command: Command
) -> None:
    project = _with_disc(tmp_path)
    before = project.picks.read_bytes()

    done = command("picks", "targets", project.path)

    assert done.status == 0, done
    rows = {row["image"]: row for row in project.rows() if row["source"] == "target"}
    assert set(rows) == set(NAMES[1:])
    for name, row in rows.items():
        assert row["label"] == "P5"
        off = np.array([float(row["u_px"]), float(row["v_px"])]) - project.pixel_px[name, "P5"]
        assert np.abs(off).max() < min(4.0 * float(row["sigma_px"]), 0.25)
    assert "P5: a round target, found in 2 more photos" in done.stdout
    assert project.rows()[0]["u_px"] == before.decode().splitlines()[1].split(",")[2]

    again = project.picks.read_bytes()
    assert command("picks", "targets", project.path).status == 0
    assert project.picks.read_bytes() == again
    assert command("picks", "targets", project.path, "--undo").status == 0
    assert not [row for row in project.rows() if row.get("source") == "target"]


def test_where_it_is_covered_it_is_not_picked_and_that_is_said(
    tmp_path: Path, command: Command
) -> None:
    project = _with_disc(tmp_path)
    photo = cv2.imread(str(tmp_path / "c.png"), cv2.IMREAD_GRAYSCALE)
    assert photo is not None
    u, v = np.round(project.pixel_px["c.png", "P5"]).astype(int).tolist()
    photo[v - 14 : v + 15, u - 14 : u] = 120
    cv2.imwrite(str(tmp_path / "c.png"), photo)

    done = command("picks", "targets", project.path)

    assert done.status == 0, done
    assert [row["image"] for row in project.rows() if row["source"] == "target"] == ["b.png"]
    assert "looked for but not taken in 1 photos (c.png" in done.stdout


def _with_disc(folder: Path) -> Textured:
    """The project with a disc of a dark rim about one label in every photo."""
    project = write_textured(folder)
    for name in NAMES:
        photo = cv2.imread(str(folder / name), cv2.IMREAD_GRAYSCALE)
        assert photo is not None
        u, v = np.round(project.pixel_px[name, "P5"] * 2**SHIFT).astype(int).tolist()
        for radius, grey in ((11, 20), (8, 235)):
            cv2.circle(photo, (u, v), radius * 2**SHIFT, (grey,), cv2.FILLED, cv2.LINE_AA, SHIFT)
        cv2.imwrite(str(folder / name), cv2.GaussianBlur(photo, (0, 0), 0.6))
    return project
