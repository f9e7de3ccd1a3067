"""`uavgram view` and `uavgram run --view`: which recording is shown, and how it ends."""

from __future__ import annotations

import json
import os
import resource
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Never

import pytest
from csv_rows import read_rows
from small_projects import Command, Project

from uavgram.errors import UavgramError
from uavgram.io.outputs import SupersededError
from uavgram.io.results.command_json import append_record, read_records
from uavgram.model.batch import SurveyRecord, SurveyStatus
from uavgram.pipeline import batch
from uavgram.pipeline.batch import Outcome, Requests, Task, add_present_results, measure_survey
from uavgram.pipeline.processes import ItemOutcome
from uavgram.views import viewer


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Recordings that were opened on the screen, without opening any."""
    calls: list[Path] = []
    monkeypatch.setattr(viewer, "open_viewer", calls.append)
    return calls


def test_a_run_opens_the_review_that_it_wrote(
    project: Project, command: Command, shown: list[Path], tmp_path: Path
) -> None:
    assert command("run", project.path, "--view").status == 0
    assert command("run", project.path, "--view", "--output", tmp_path / "other").status == 0
    assert command("run", project.path).status == 0

    assert shown == [project.out / "recording.rrd", tmp_path / "other" / "recording.rrd"]
    assert all(path.is_file() for path in shown)


def test_on_a_screen_the_recording_itself_is_opened(
    project: Project, command: Command, shown: list[Path]
) -> None:
    assert command("view", project.out / "recording.rrd").status == 0
    assert shown == [project.out / "recording.rrd"]


def test_in_a_browser_the_address_is_said_and_ctrl_c_is_the_end(
    project: Project, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def serve(recording: Path, started: Callable[[str], None]) -> Never:
        assert recording == project.out / "recording.rrd"
        started("http://127.0.0.1:1234?url=x")
        raise KeyboardInterrupt

    monkeypatch.setattr(viewer, "serve_viewer", serve)

    done = command("view", project.out / "recording.rrd", "--web")

    assert done.status == 130
    assert "open http://127.0.0.1:1234?url=x\nCtrl+C ends it" in done.stdout
    assert done.stderr == "uavgram: interrupted; no result is half written\n"


@pytest.mark.parametrize("flags", [[], ["--web"]])
def test_what_is_no_recording_is_one_message(
    project: Project, command: Command, flags: list[str]
) -> None:
    done = command("view", project.path, *flags)

    assert done.status == 1
    assert "project.yaml: is not a Rerun recording" in done.stderr


# `uavgram batch`: every survey is measured once, its results are those of `uavgram run`.


def table(folder: Path) -> dict[str, dict[str, str]]:
    """Rows of batch.csv by the name of the survey's folder."""
    return {Path(row["project"]).parent.name: row for row in read_rows(folder / "batch.csv")}


def told(results: Path) -> object:
    """results.json without the moment of its making and the photos' place on this machine."""
    content = json.loads(results.read_text(encoding="utf-8"))
    del content["provenance"]
    for frame in content["frames"]:
        del frame["path"]
    return content


@pytest.mark.usefixtures("_in_this_process")
def test_a_batch_measures_what_run_measures_and_names_what_it_cannot(
    small_survey: Path, tmp_path: Path, command: Command
) -> None:
    for name in ("good", "poisoned"):
        shutil.copytree(small_survey, tmp_path / "all" / name)
        shutil.rmtree(tmp_path / "all" / name / "out")
    with (tmp_path / "all" / "poisoned" / "picks.csv").open("a", encoding="utf-8") as stream:
        stream.write("nonsense\n")

    done = command("batch", tmp_path / "all", "--output", tmp_path / "b")
    rows = table(tmp_path / "b")

    assert done.status == 1
    assert "2 surveys: 1 measured, 0 unchanged, 1 failed" in done.stdout
    assert rows["good"]["status"] == "done"
    assert rows["good"]["verdict"] in {"green", "amber", "red"}
    assert rows["poisoned"]["status"] == "failed"
    assert "picks.csv" in rows["poisoned"]["message"]
    assert not (tmp_path / "all" / "poisoned" / "out").exists()
    ours, theirs = tmp_path / "all" / "good" / "out", small_survey / "out"
    assert told(ours / "results.json") == told(theirs / "results.json")
    assert {path.name for path in ours.iterdir()} == {path.name for path in theirs.iterdir()}
    page = (tmp_path / "b" / "batch.html").read_text(encoding="utf-8")
    assert 'href="../all/good/out/report.html"' in page


@pytest.fixture
def _in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Surveys one after another in this process, which costs no imports."""

    def here(
        work: Callable[[Task], Outcome], items: Sequence[Task], *_: object
    ) -> Iterator[ItemOutcome[Outcome]]:
        for number, item in enumerate(items):
            yield ItemOutcome(number, work(item), 1)

    monkeypatch.setattr(batch, "run_in_workers", here)


@pytest.fixture(scope="module")
def measured(
    small_survey: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, SurveyRecord]:
    """A survey that a batch measured, and what it keeps of it."""
    folder = tmp_path_factory.mktemp("measured") / "survey"
    shutil.copytree(small_survey, folder)
    outcome = measure_survey(Task(project=str(folder / "project.yaml"), asked=Requests()))
    assert outcome.record is not None
    return folder, outcome.record


def again(record: SurveyRecord, asked: Requests | None = None) -> str:
    """Status of a survey that is asked for again; ``run`` where that would run it."""
    task = Task(project=record.row.project, asked=asked or Requests(), before=record)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batch, "run", refuse)
        row = measure_survey(task).row
    return "run" if row.message == "would run" else row.status


def refuse(*_: object, **__: object) -> None:
    raise UavgramError("would run")


def test_what_is_unchanged_is_not_measured_again(measured: tuple[Path, SurveyRecord]) -> None:
    folder, record = measured
    os.utime(folder / "picks.csv")

    assert again(record) == "unchanged"


@pytest.mark.parametrize("what", ["picks.csv", "project.yaml", "a photo", "results", "new photo"])
def test_what_changed_is_measured_again(what: str, measured: tuple[Path, SurveyRecord]) -> None:
    folder, record = measured
    photo = next(
        path for path in map(Path, (s.path for s in record.inputs)) if path.suffix == ".jpg"
    )
    file = {"a photo": photo, "results": folder / "out" / "results.json"}.get(what, folder / what)
    if what == "new photo":
        file = photo.with_name("zz_new.jpg")
        shutil.copy(photo, file)
        assert again(record) == "run"
        file.unlink()
    else:
        before = file.read_bytes()
        # of the same size, as an edited digit is
        file.write_bytes(before[:-1] + bytes([before[-1] ^ 1]))
        assert again(record) in {"run", "failed"}
        file.write_bytes(before)

    assert again(record) == "unchanged"


def test_other_options_and_another_version_are_measured_again(
    measured: tuple[Path, SurveyRecord], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, record = measured

    assert again(record, Requests(pdf="a4")) == "run"
    monkeypatch.setattr(batch, "stamp", lambda: {"version": "99"})
    assert again(record) == "run"


def test_a_record_is_kept_though_a_killed_batch_cut_the_last_line_short(
    measured: tuple[Path, SurveyRecord], tmp_path: Path
) -> None:
    _, record = measured
    state = tmp_path / "new" / "state.jsonl"
    append_record(state, record)
    state.write_bytes(state.read_bytes() + state.read_bytes()[:100])
    append_record(state, record)

    assert len(state.read_bytes().splitlines()) == 3
    assert repr(read_records(state)) == repr({record.row.project: record})


def test_a_full_disk_is_named_and_leaves_earlier_results(
    measured: tuple[Path, SurveyRecord],
) -> None:
    folder, record = measured
    before = (folder / "out" / "results.json").read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        row = measure_survey(Task(project=record.row.project, asked=Requests())).row
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))

    assert row.status == "failed"
    assert "disk is full" in row.message
    assert (folder / "out" / "results.json").read_bytes() == before
    assert not list((folder / "out").glob(".uavgram*"))


def test_what_a_worker_made_that_could_not_tell_is_not_measured_again(
    measured: tuple[Path, SurveyRecord],
) -> None:
    folder, record = measured
    left = folder / "out" / batch.LEFT
    task = add_present_results(Task(project=record.row.project, asked=Requests(), before=None))
    append_record(left, record)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batch, "run", refuse)
        found = measure_survey(task)
        again = measure_survey(task)

    assert (found.row.status, found.record) == ("done", record)
    assert not left.exists()
    assert again.row.message == "would run"


def test_a_worker_that_begins_late_measures_nothing_that_another_has_measured(
    measured: tuple[Path, SurveyRecord],
) -> None:
    folder, record = measured
    results = folder / "out" / "results.json"
    task = add_present_results(Task(project=record.row.project, asked=Requests(), before=None))
    os.utime(results)  # another worker wrote them meanwhile
    before = results.read_bytes()

    with pytest.raises(SupersededError, match="another process"):
        measure_survey(task)

    assert results.read_bytes() == before
    assert not list((folder / "out").glob(".uavgram*"))


@pytest.mark.usefixtures("_in_this_process")
def test_an_interrupted_batch_says_what_waits_and_goes_on(
    measured: tuple[Path, SurveyRecord], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, record = measured
    names = ["a", "b", "c"]
    for name in names:
        (tmp_path / name).mkdir()
        (tmp_path / name / "project.yaml").touch()
    seen: list[str] = []

    def fake(task: Task) -> Outcome:
        seen.append(Path(task.project).parent.name)
        row = record.row
        new = SurveyRecord(
            row=type(row)(name=seen[-1], project=task.project, status="done", level="green"),
            version=record.version,
            asked=record.asked,
            inputs=(),
            results=record.results,
        )
        status: SurveyStatus = "done" if task.before is None else "unchanged"
        again = type(row)(name=seen[-1], project=task.project, status=status, level="green")
        return Outcome(row=again, record=new)

    def interrupt(step: batch.Step) -> None:
        if step.ended == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(batch, "measure_survey", fake)
    with pytest.raises(KeyboardInterrupt):
        batch.run_batch([tmp_path], tmp_path / "out", tell=interrupt)
    first = {name: row["status"] for name, row in table(tmp_path / "out").items()}
    batch.run_batch([tmp_path], tmp_path / "out")
    second = {name: row["status"] for name, row in table(tmp_path / "out").items()}

    assert first == {"a": "done", "b": "done", "c": "waiting"}
    assert second == {"a": "unchanged", "b": "unchanged", "c": "done"}


@pytest.mark.usefixtures("_in_this_process")
def test_two_surveys_never_write_into_one_folder(project: Project) -> None:
    shutil.copy(project.path, project / "other.yaml")
    tasks = [
        Task(project=str(project / name), asked=Requests())
        for name in ("project.yaml", "other.yaml")
    ]

    clashes = batch._find_clashes(tasks)

    assert list(clashes) == [str(project / "other.yaml")]
    assert str(project.path) in clashes[str(project / "other.yaml")].row.message


def test_tls_files_without_a_scheduler_are_refused(command: Command, project: Project) -> None:
    done = command("batch", project.path, "--tls-cert", "cert.pem")

    assert done.status == 1
    assert "--scheduler" in done.stderr
