"""A run that has the same to say of many frames, or of many measurements, says it once."""

from __future__ import annotations

import csv

from small_projects import Project

import uavgram

FULL_FRAMES = 6


def test_many_frames_and_many_measurements_are_one_message_each(project: Project) -> None:
    with (project / "picks.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    names = sorted({row["image"] for row in rows})
    poor = names[FULL_FRAMES:]  # without a log, a single pick places no frame
    first = {row["image"]: row for row in reversed(rows)}
    kept = [row for row in rows if row["image"] not in poor] + [first[name] for name in poor]
    for row in kept:
        row["sigma_px"] = "5"
    with (project / "picks.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(kept)
    requests = [f"place of P{k},coordinate,P{k}," for k in range(1, 14)]
    (project / "measure.csv").write_text("name,kind,points,parameters\n" + "\n".join(requests))
    project.set(log=None, time=None, mount=None)

    result = uavgram.run(project.path, output=None)

    (left_out,) = [m for m in result.messages if m.code == "frame-left-out"]
    assert left_out.text.startswith(f"{len(poor)} photos were left out, with all of their picks: ")
    assert left_out.frames == tuple(poor)
    (doubtful,) = [m for m in result.messages if m.code == "first-order-doubtful"]
    number = len(doubtful.measurements)
    assert number >= 13
    assert doubtful.text.startswith(f"The uncertainties of {number} measurements are approximate: ")
    assert doubtful.text.endswith("Run again with --monte-carlo for their exact intervals.")
