"""Opening somebody's unpacked project writes nothing outside it, whatever links lie in it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from pick_pages import PROJECT, small_project

from uavgram.errors import InputError, OutputError, UavgramError
from uavgram.io.outputs import JOURNAL, LOCK
from uavgram.picking.document import commands as c
from uavgram.picking.session.outputs import FILES, RECORDING, RESULTS, Outputs
from uavgram.picking.storage.journal import find_oldest
from uavgram.picking.storage.tables import Tables
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.measure.run import run
from uavgram.pipeline.pick.live_survey import LiveSurvey


@pytest.fixture
def project(tmp_path: Path) -> Iterator[Path]:
    path = small_project(tmp_path / "project")
    (path.parent / "picks.csv").write_text("image,label,u_px,v_px\nP1.jpg,A,5,6\n")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "victim").write_text("precious")
    yield path
    assert (tmp_path / "elsewhere" / "victim").read_text() == "precious"
    assert os.listdir(tmp_path / "elsewhere") == ["victim"]  # noqa: PTH208


@pytest.mark.parametrize("name", [LOCK, JOURNAL])
@pytest.mark.parametrize("there", ["victim", "nothing yet"])
def test_lock_and_journal_are_written_through_no_link(project: Path, name: str, there: str) -> None:
    (project.parent / "out").mkdir()
    link = project.parent / "out" / name
    link.symlink_to(f"../../elsewhere/{there}")
    with pytest.raises(OutputError, match=rf"{name}: is a link .*remove it"):
        Tables(read_inputs(project, unfinished=True))
    link.unlink()
    link.hardlink_to(project.parent / "camera.yaml")  # a second name does the same
    before = link.read_bytes()
    with pytest.raises(OutputError, match=rf"{name}: is a link .*remove it"):
        Tables(read_inputs(project, unfinished=True))
    assert link.read_bytes() == before
    link.unlink()
    os.mkfifo(link)  # and a pipe would wait for ever
    with pytest.raises(UavgramError, match=name):
        Tables(read_inputs(project, unfinished=True))


@pytest.mark.parametrize(
    ("output", "link", "said"),
    [
        ("out", "out", "is a link, or is in one, that leads out of the project's folder"),
        ("over/out", "over", "is a link, or is in one, that leads out of the project's folder"),
        ("../elsewhere", "", "is outside the project's folder"),
    ],
)
def test_an_output_folder_elsewhere_is_refused(
    project: Path, output: str, link: str, said: str
) -> None:
    if link:
        (project.parent / link).symlink_to("../elsewhere")
    project.write_text(PROJECT.replace("output: out", f"output: {output}"))
    with pytest.raises(OutputError, match=said):
        Tables(read_inputs(project, unfinished=True))
    if link:
        lines = "name,from,to,length_m,sigma_m\nL,A,B,2,0.1\n"
        (project.parent / "lines.csv").write_text(lines)
        (project.parent / "measure.csv").write_text("name,kind,points\nM,distance,A;B\n")
        with pytest.raises(OutputError, match=said):
            run(project)


def test_a_table_elsewhere_is_refused(project: Path) -> None:
    elsewhere = project.parent.parent / "elsewhere"
    picks = project.parent / "picks.csv"
    picks.unlink()
    picks.symlink_to("../elsewhere/new.csv")
    with pytest.raises(OutputError, match=r"picks\.csv .*is a link.*put a copy"):
        Tables(read_inputs(project, unfinished=True))
    picks.unlink()
    project.write_text(PROJECT.replace("picks: picks.csv", f"picks: {elsewhere}/new.csv"))
    with pytest.raises(OutputError, match=r"new\.csv .*is outside"):
        Tables(read_inputs(project, unfinished=True))


def test_links_inside_the_project_are_followed(project: Path) -> None:
    (project.parent / "kept").mkdir()
    (project.parent / "out").symlink_to("kept")
    tables = Tables(LiveSurvey.open(project).inputs)
    tables.record(c.Unpick(image="P1.jpg", label="A"), 0)
    tables.close()
    assert (project.parent / "kept" / JOURNAL).is_file()


def test_nothing_is_read_through_a_link_among_the_outputs(project: Path) -> None:
    out = project.parent / "out"
    out.mkdir()
    for name in (RESULTS, "report.html", RECORDING, "pick-journal-1.jsonl"):
        (out / name).symlink_to("../../elsewhere/victim")
    (out / "survey.kml").hardlink_to(project)
    os.mkfifo(out / "points.geojson")
    (out / "measurements.csv").write_text("name,value\n")
    outputs = Outputs(out)
    assert {name: outputs.read(name) for name in FILES if outputs.read(name) is not None} == {
        "measurements.csv": b"name,value\n"
    }
    assert [one["name"] for one in outputs.list_files()] == ["measurements.csv"]
    assert outputs.made_of is None
    assert not outputs.has_recording
    with pytest.raises(InputError, match="is not there yet"):
        outputs.viewer()
    assert find_oldest(out) is None
