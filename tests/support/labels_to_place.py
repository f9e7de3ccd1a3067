"""Two photos of one place; in the second some labels are yet to be placed."""

from __future__ import annotations

from pathlib import Path

from csv_rows import read_rows, write_rows
from large_photos import write_large_project

LABELS = 24
ALONE = tuple(f"P{k}" for k in range(17, 23))
"""Labels that the second photo is to be asked for: no length or distance hangs on them."""

TWIN, TWIN_ASIDE_PX = "twin", 14.0
"""A label so near to `ALONE[0]` that a click between them may mean both."""

MOVING = ("P23", "P24")


def write_survey(folder: Path) -> tuple[Path, dict[str, tuple[float, float]]]:
    """Two photos; the second is yet without `ALONE`, and without what moves."""
    project = write_large_project(folder, 1600, 1200, labels=LABELS)
    rows = read_rows(folder / "picks.csv")
    second = [row for row in rows if row["image"] == "photo1.jpg"]
    places = {row["label"]: (float(row["u_px"]), float(row["v_px"])) for row in second}
    lacking = {*ALONE, *MOVING}
    kept = [row for row in rows if row["image"] == "photo0.jpg" or row["label"] not in lacking]
    (beside,) = (r for r in rows if (r["image"], r["label"]) == ("photo0.jpg", ALONE[0]))
    kept.append(beside | {"label": TWIN, "u_px": str(float(beside["u_px"]) + TWIN_ASIDE_PX)})
    write_rows((folder / "picks.csv"), kept)
    with (folder / "measure.csv").open("a") as stream:
        stream.write(f"S1,speed,{';'.join(MOVING)}\n")
    return project, places
