"""What is missing but no mistake: kept and told, status 0."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest
from small_projects import Command, Project

import uavgram
from uavgram.model.result.result import Result

Runs = Callable[[], tuple[Result, str]]


@pytest.fixture
def runs(command: Command, project: Project) -> Runs:
    """Run the project: status 0; results as read back, and what was said."""

    def run() -> tuple[Result, str]:
        done = command("run", project.path)
        assert done.status == 0, done.stderr
        assert done.stderr == ""
        return uavgram.load_results(project.out / "results.json"), done.stdout

    return run


def messages(result: Result, code: str) -> list[str]:
    return [message.text for message in result.messages if message.code == code]


def test_a_length_with_an_end_never_picked_is_unseen(project: Project, runs: Runs) -> None:
    project.cell("lines.csv", 2, "from", "R33")
    result, said = runs()
    assert result.lines.status[1] == "unseen"
    assert str(result.lines.adjusted_m[1]) == "nan"
    (text,) = messages(result, "line-unseen")
    assert "'L2'" in text
    assert "did you mean 'R" in text
    assert f"warning: {text}" in said
    reason = next(one for one in result.verdict.reasons if one.cause == "line-unseen")
    assert result.verdict.level == "amber"
    assert reason.plain == "L2 is not used: a point of it is not picked."
    assert json.loads((project.out / "results.json").read_text())["lines"][1]["adjusted_m"] is None


def test_all_other_numbers_are_those_of_the_project_without_that_length(
    project: Project, runs: Runs
) -> None:
    lines = (project / "lines.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    project.cell("lines.csv", 2, "from", "nobody")
    unseen, _ = runs()
    (project / "lines.csv").write_text("".join(lines[:2] + lines[3:]), encoding="utf-8")
    without, _ = runs()
    assert unseen.measurements.value.tolist() == without.measurements.value.tolist()


def test_a_measurement_of_a_label_never_picked_is_null(project: Project, runs: Runs) -> None:
    project.cell("measure.csv", 1, "points", "P1;P22")
    result, said = runs()
    content = json.loads((project.out / "results.json").read_text())
    assert content["measurements"][0]["value"] is None
    assert content["measurements"][0]["sigma"] is None
    (text,) = messages(result, "measurement-null")
    assert "'skid left'" in text
    assert "'P22'" in text
    assert "did you mean 'P2'" in text
    assert f"warning: {text}" in said
    assert (project.out / "measurements.csv").read_text().splitlines()[1].count(",,") >= 1


def test_a_check_point_never_picked_is_told(project: Project, runs: Runs) -> None:
    project.cell("check.csv", 1, "label", "C11")
    result, _ = runs()
    assert "C11" not in result.point_checks.label
    assert any("'C11'" in message.text for message in result.messages)


def test_a_photo_outside_the_flight_is_unmatched(project: Project, runs: Runs) -> None:
    photo = project / "photos" / "IMG_0013.jpg"
    encoded = photo.read_bytes()
    assert b"2026:05:09 07:" in encoded
    photo.write_bytes(encoded.replace(b"2026:05:09 07:", b"2026:05:09 11:"))
    result, said = runs()
    assert result.frames.status == ("refined",) * 12 + ("unmatched",)
    assert "after the log ends" in result.frames.reason[12]
    assert not result.has_refined[12]
    assert not result.has_seed[12]
    (text,) = messages(result, "frame-unmatched")
    assert "IMG_0013.jpg" in text
    assert said.count(text) == 2  # as a message, and as a reason of the verdict
    picks = zip(result.picks.image, result.picks.status, strict=True)
    assert {status for image, status in picks if image == "IMG_0013.jpg"} == {"unused"}


def test_a_photo_without_picks_is_seeded(project: Project, runs: Runs) -> None:
    lines = (project / "picks.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith("IMG_0004")]
    (project / "picks.csv").write_text("".join(kept), encoding="utf-8")
    result, _ = runs()
    assert result.frames.status[3] == "seeded"
    assert result.has_seed[3]


def test_check_tells_of_labels_never_picked_and_suggests_the_near_miss(
    project: Project, command: Command
) -> None:
    project.cell("lines.csv", 2, "from", "R33")
    project.cell("measure.csv", 1, "points", "P1;P22")
    done = command("check", project.path)
    assert done.status == 0
    (said,) = [line for line in done.stdout.splitlines() if "never picked" in line]
    assert said.startswith("warning: 2 points are never picked: ")
    assert "'R33' of line 'L2' (did you mean 'R" in said
    assert "'P22' of measurement 'skid left' (did you mean 'P2'?)" in said


def test_without_measurements_the_table_says_so(project: Project, command: Command) -> None:
    project.set(measure=None)
    done = command("run", project.path)
    assert done.status == 0
    assert "No measurements were requested" in done.stdout


def test_measurements_of_nothing_but_labels_never_picked_are_all_null(
    project: Project, runs: Runs
) -> None:
    header = (project / "measure.csv").read_text(encoding="utf-8").splitlines()[0]
    commas = "," * (header.count(",") - 2)
    rows = [f"{name},distance,X1;X2{commas}" for name in ("one", "two")]
    (project / "measure.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    result, _ = runs()
    assert [str(value) for value in result.measurements.value] == ["nan", "nan"]
    (said,) = [m for m in result.messages if m.code == "measurement-null"]
    assert said.measurements == ("one", "two")
    assert said.text.startswith("2 measurements have no value: 'one', 'two' (")


def test_a_control_point_never_picked_keeps_the_verdict_from_green(
    project: Project, runs: Runs
) -> None:
    control = (project / "check.csv").read_text(encoding="utf-8")
    (project / "control.csv").write_text(control.replace("\nC1,", "\nC11,"), encoding="utf-8")
    project.set(control="control.csv", check=None)
    result, _ = runs()
    (text,) = messages(result, "control-unseen")
    assert "'C11'" in text
    reason = next(one for one in result.verdict.reasons if one.cause == "control-unseen")
    assert reason.labels == ("C11",)
    assert reason.plain == "The control point C11 is not used: it is not picked."
    assert result.verdict.level == "amber"


def test_a_known_thing_with_a_point_never_picked_keeps_the_verdict_from_green(
    project: Project, runs: Runs
) -> None:
    (project / "known.csv").write_text(
        "name,kind,points,value,sigma\nkerb,distance,Rl;R2,12,0.1\n", encoding="utf-8"
    )
    project.set(known="known.csv")
    result, _ = runs()
    (text,) = messages(result, "known-unseen")
    assert "'Rl' (did you mean 'R1'?)" in text
    assert "known-unseen" in [reason.cause for reason in result.verdict.reasons]
