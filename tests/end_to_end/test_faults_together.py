"""Three faults in one survey: each is told for what it is, and none hides or mimics another."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from csv_rows import Row, read_rows, write_rows
from flight_projects import copy_project

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

Faulty = tuple[Result, str, str, tuple[str, str], str]
"""A result; its photo of nonsense, that with swapped labels, these, and the misread line."""

FRAMES = 6
WRONG_M, TAPE_M = 0.6, 0.01


def place(row: Row) -> Floats:
    return np.array([float(row["u_px"]), float(row["v_px"])])


@pytest.fixture(scope="module")
def faulty(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Faulty:
    """A twin of which one photo shows nonsense, one has two labels swapped, and a tape misread."""
    source, folder = data_dir / "calm_nadir", tmp_path_factory.mktemp("faulty")
    rows = read_rows(source / "picks.csv")
    names, counts = np.unique([row["image"] for row in rows], return_counts=True)
    chosen = names[np.argsort(-counts, kind="stable")[:FRAMES]].tolist()
    rows = [row for row in rows if row["image"] in chosen]
    # A point that one photo shows only tells nothing here, and costs as much as any other.
    seen = Counter(row["label"] for row in rows)
    rows = [row for row in rows if seen[row["label"]] > 1]
    nonsense, swapped = chosen[4], chosen[0]
    rng = np.random.default_rng(0)
    for row in rows:
        if row["image"] == nonsense:
            row["u_px"], row["v_px"] = (f"{value:.1f}" for value in rng.uniform(300, 1500, 2))
    mine = [row for row in rows if row["image"] == swapped]
    one = mine[0]
    other = max(mine, key=lambda row: np.linalg.norm(place(row) - place(one)))
    labels = one["label"], other["label"]
    other["label"], one["label"] = labels
    lines = read_rows(source / "lines.csv")
    lines[0]["length_m"] = f"{float(lines[0]['length_m']) + WRONG_M:.3f}"
    write_rows(folder / "picks.csv", rows)
    write_rows(folder / "lines.csv", lines)
    project = copy_project(source, folder, picks="picks.csv", lines="lines.csv")
    result = compute(read_inputs(project), curved=False).result
    return result, nonsense, swapped, labels, lines[0]["name"]


def texts_of(result: Result, code: str) -> list[str]:
    return [message.text for message in result.messages if message.code == code]


def test_the_photo_of_nonsense_is_left_out_by_name(faulty: Faulty) -> None:
    result, nonsense, *_ = faulty
    (text,) = texts_of(result, "frame-left-out")
    assert repr(nonsense) in text
    status = dict(zip(result.frames.frame_id, result.frames.status, strict=True))
    assert [name for name, state in status.items() if state == "rejected"] == [nonsense]
    assert list(status.values()).count("refined") == FRAMES - 1
    reasons = dict(zip(result.frames.frame_id, result.frames.reason, strict=True))
    # With a log its picks have places, which nothing else shares.
    assert "labels in disorder" in reasons[nonsense]
    (cause,) = [m for m in result.messages if m.code == "photo-elsewhere"]
    assert (cause.level, cause.frames) == ("warning", (nonsense,))


def test_the_swapped_labels_are_named_as_swapped_and_their_photo_stays(faulty: Faulty) -> None:
    result, _, swapped, labels, _ = faulty
    warnings = [m for m in result.messages if m.level == "warning"]
    assert warnings[0].code == "labels-swapped"  # the cause first
    assert (warnings[0].frames, set(warnings[0].labels)) == ((swapped,), set(labels))
    assert "Each pick is at the place of the other" in warnings[0].text
    (said,) = [m for m in result.messages if m.code == "pick-left-out"]
    assert (said.level, said.frames, set(said.labels)) == ("info", (swapped,), set(labels))
    for label in labels:
        assert f"{label!r} in {swapped!r}" in said.text
    assert "it fits under another label of its photo" in said.text


def test_the_misread_tape_is_the_one_that_is_left_out(faulty: Faulty) -> None:
    result, *_, line = faulty
    (text,) = texts_of(result, "line-left-out")
    assert repr(line) in text
    status = dict(zip(result.lines.name, result.lines.status, strict=True))
    assert {name: state for name, state in status.items() if state != "used"} == {line: "removed"}
    assert "suspect" not in result.picks.status
    bias = dict(zip(result.lines.name, result.lines.residual_m, strict=True))[line]
    assert bias < -10 * TAPE_M


def test_the_rest_comes_to_rest(faulty: Faulty) -> None:
    result, *_ = faulty
    assert result.solution.converged
    assert result.solution.chi2_probability > 1e-3
