"""What a session leaves on disk: exact bytes, nothing of others written over, one page."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Never

import numpy as np
import pytest
from pick_pages import Page, RefusedToStartError, Server, running, small_project

from uavgram.errors import InputError, OutputError, UavgramError
from uavgram.io.outputs import JOURNAL, LOCK, ProjectLock
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import Command
from uavgram.picking.document.history import Session, apply
from uavgram.picking.document.state import Pick, State
from uavgram.picking.protocol.parse import Message
from uavgram.picking.session.session import PickSession
from uavgram.picking.session.workers import Task
from uavgram.picking.storage.journal import Journal, load_journal
from uavgram.picking.storage.tables import FileWatch, Tables
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.pick.live_survey import LiveSurvey

PICKS = (
    b"\xef\xbb\xbfWho saw it,label,note,image,v_px,u_px\r\n"
    b"Ada,A,the kerb,P1.jpg,20.50,010.0\r\n"
    b"\r\n"
    b'"Bo, too","B","x, y",P1.jpg,4e1,30\r\n'
    b"007,A,,P2.jpg,60.000,50"
)
LINES = b"name,from,to,length_m,sigma_m,note,whose\nL1,A,B,11.5200,0.010,taped twice, 3 \n"
MEASURE = b"name,kind,points,asked by\nD, distance ,A;B,court\n\n\n"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    path = small_project(tmp_path)
    (tmp_path / "picks.csv").write_bytes(PICKS)
    (tmp_path / "lines.csv").write_bytes(LINES)
    (tmp_path / "measure.csv").write_bytes(MEASURE)
    return path


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.csv*"))}


def test_picks_in_a_damaged_photo_stay_in_the_table(project: Path) -> None:
    photo = project.parent / "photos" / "P1.jpg"
    whole = photo.read_bytes()
    photo.write_bytes(whole[:-200])
    work = Working(project)
    assert {pick.image for pick in work.session.state.picks} == {"P2.jpg"}

    work.do(c.Place(image="P2.jpg", label="A", u_px=51.0, v_px=60.0))
    work.do(c.Place(image="P2.jpg", label="C", u_px=7.0, v_px=8.0))
    assert work.save() == ""
    table = (project.parent / "picks.csv").read_bytes()
    assert table.startswith(PICKS[: PICKS.index(b"007")])
    assert table.endswith(b"007,A,,P2.jpg,60.000,51.0\r\n,C,,P2.jpg,8.0,7.0")
    work.tables.close()

    photo.write_bytes(whole)
    picks = read_inputs(project, unfinished=True).picks
    assert list(zip(picks.image, picks.label, strict=True)) == [
        ("P1.jpg", "A"),
        ("P1.jpg", "B"),
        ("P2.jpg", "A"),
        ("P2.jpg", "C"),
    ]


def test_a_repaired_photo_keeps_its_picks_after_a_crash(project: Path) -> None:
    photo = project.parent / "photos" / "P1.jpg"
    whole = photo.read_bytes()
    photo.write_bytes(b"")
    work = Working(project)
    work.do(c.Place(image="P2.jpg", label="C", u_px=7.0, v_px=8.0))
    work.tables.close()  # not saved, as after a crash
    photo.write_bytes(whole)
    work = Working(project)

    assert work.tables.messages[0].code == "pick-not-recovered"
    assert {pick.image for pick in work.session.state.picks} == {"P1.jpg", "P2.jpg"}
    work.tables.close()


class Working:
    """Tables and the session that they keep, without a server."""

    def __init__(self, project: Path) -> None:
        inputs = LiveSurvey.open(project).inputs
        self.tables = Tables(inputs)
        self.session = Session(state=self.tables.recovered or self.tables._files)

    def do(self, command: Command, step: int = 0) -> None:
        self.session = apply(self.session, command, step)
        self.tables.record(command, step)

    def save(self) -> str:
        return self.tables.save(self.session.state)


def every_command() -> Iterator[Command]:
    yield c.Place(image="P1.jpg", label="A", u_px=11.0, v_px=20.5)
    yield c.Place(image="P2.jpg", label="C", u_px=1.0, v_px=2.0, sigma_px=0.25)
    yield c.Repeat(image="P1.jpg", label="A", u_px=11.5, v_px=20.0)
    yield c.Repeat(image="P2.jpg", label="C", u_px=1.5, v_px=2.5)
    yield c.Unpick(image="P1.jpg", label="B")
    yield c.Unpick(image="P2.jpg", label="C")
    yield c.Place(image="P2.jpg", label="C", u_px=1.0, v_px=2.0, sigma_px=0.25)
    yield c.Rename(label="A", new="kerb; no".replace(";", ","))
    yield c.SetSigma(image="P2.jpg", label="C", sigma_px=0.5)
    yield c.SetHeight(label="C", height_m=0.15)
    yield c.SetLine(
        was="L1", name="long", start="C", end="B", length_m=2.0, sigma_m=0.1, adjust=False
    )
    yield c.RemoveLine(name="long")
    yield c.SetMeasurement(was="", name="D2", kind="distance", points=("C", "B"))
    yield c.RemoveMeasurement(name="D")
    yield c.Forget(label="C")


def test_columns_of_a_persons_own_are_told_and_stay_as_they_are(
    project: Path, tmp_path: Path
) -> None:
    inputs = read_inputs(project, unfinished=True)
    texts = [message.text for message in inputs.messages if message.code == "own-columns"]
    assert [text.split(":")[0] for text in texts] == ["picks.csv", "lines.csv", "measure.csv"]
    assert "'Who saw it'" in texts[0]
    work = Working(project)
    work.do(c.Place(image="P2.jpg", label="A", u_px=51.5, v_px=60.0))
    work.do(c.Place(image="P2.jpg", label="New", u_px=1.0, v_px=2.0))
    work.do(c.Rename(label="B", new="C"))
    assert work.save() == ""
    work.tables.close()
    changed = PICKS.replace(b"P2.jpg,60.000,50", b"P2.jpg,60.000,51.5").replace(b'"B"', b"C")
    assert files(tmp_path)["picks.csv"] == changed + b"\r\n,New,,P2.jpg,2.0,1.0"
    assert files(tmp_path)["lines.csv"] == LINES.replace(b"A,B,11", b"A,C,11")
    assert files(tmp_path)["measure.csv"] == MEASURE.replace(b"A;B", b"A;C")
    read_inputs(project, unfinished=True)  # and the program reads what it wrote


def test_undo_to_the_start_leaves_the_files_byte_for_byte_as_they_were(
    project: Path, tmp_path: Path
) -> None:
    before = files(tmp_path)
    work = Working(project)
    steps = 0
    for command in every_command():
        work.do(command)
        steps += 1
        assert work.save() == ""
    changed = files(tmp_path)
    assert all(changed[name] != before[name] for name in before)
    reread = read_inputs(project, unfinished=True)
    assert reread.picks.label == tuple(pick.label for pick in work.session.state.picks)
    for _ in range(steps):
        work.do(c.Undo())
        assert work.save() == ""
    work.tables.close()
    after = files(tmp_path)
    assert {name: after[name] for name in before} == before
    backups = {f"{name}.bak": content for name, content in before.items()}
    assert {name: after[name] for name in backups} == backups


def test_files_that_were_not_there_are_gone_again_after_undo(tmp_path: Path) -> None:
    project = small_project(tmp_path)
    with running(project) as server, Page(server) as page:
        page.do("place", image=0, label="A", u_px=1, v_px=2)
        page.do("line", was="", name="L", start="A", end="B", length_m=2, sigma_m=0.01)
        page.until("saved", fault="")
        assert sorted(files(tmp_path)) == ["lines.csv", "picks.csv"]
        page.do("undo")
        page.do("undo")
    assert files(tmp_path) == {}


def test_a_table_edited_outside_meanwhile_is_not_written_over(
    project: Path, tmp_path: Path
) -> None:
    edited = PICKS + b"\r\n,Z,from a spreadsheet,P2.jpg,7,8"
    with running(project) as server:
        with Page(server) as page:
            page.do("place", image=0, label="A", u_px=11, v_px=20.5)
            page.until("saved", fault="")
            ours = (tmp_path / "picks.csv").read_bytes()
            (tmp_path / "picks.csv").write_bytes(edited)
            page.do("place", image=1, label="A", u_px=52, v_px=60)
            said = page.until("saved")
            assert "picks.csv" in said["fault"]
            assert "picks-from-page.csv" in said["fault"]
        assert (tmp_path / "picks.csv").read_bytes() == edited
    assert (tmp_path / "picks.csv").read_bytes() == edited
    beside = (tmp_path / "picks-from-page.csv").read_bytes()
    assert beside == ours.replace(b"P2.jpg,60.000,50", b"P2.jpg,60.000,52.0")
    with running(project) as server, Page(server) as page:
        assert {pick["label"] for pick in page.initial_state["state"]["picks"]} == {"A", "B", "Z"}
        codes = [message["code"] for message in page.initial_state["messages"]]
        assert "pick-not-recovered" in codes
    asides = list((tmp_path / "out").glob("pick-journal-*.jsonl"))
    assert len(asides) == 1
    assert b'"u_px": 52.0' in asides[0].read_bytes()


def test_a_table_edited_between_two_sessions_is_simply_read(project: Path, tmp_path: Path) -> None:
    with running(project) as server, Page(server) as page:
        page.do("place", image=0, label="A", u_px=11, v_px=20.5)
    more = (tmp_path / "picks.csv").read_bytes() + b"\r\n,Z,,P2.jpg,7,8"
    (tmp_path / "picks.csv").write_bytes(more)
    with running(project) as server, Page(server) as page:
        assert not page.initial_state["recovered"]
        assert {pick["label"] for pick in page.initial_state["state"]["picks"]} == {"A", "B", "Z"}
    assert (tmp_path / "picks.csv").read_bytes() == more


def test_a_table_that_is_gone_is_written_again_from_the_journal(
    project: Path, tmp_path: Path
) -> None:
    work = Working(project)
    work.do(c.Place(image="P1.jpg", label="A", u_px=11.0, v_px=20.5))
    assert work.save() == ""
    work.tables.close()
    (tmp_path / "lines.csv").rename(tmp_path / "lines.csv.bak")

    again = Working(project)
    (message,) = again.tables.messages
    assert message.code == "pick-recovered"
    assert message.text.startswith("lines.csv was not there any more.")
    assert again.session.state == work.session.state
    assert again.save() == ""
    assert b"L1" in (tmp_path / "lines.csv").read_bytes()
    again.tables.close()
    last = Working(project)
    assert (last.tables.recovered, last.tables.messages) == (None, ())
    last.tables.close()


def test_a_table_that_is_missing_without_a_journal_is_named(project: Path, tmp_path: Path) -> None:
    (tmp_path / "lines.csv").rename(tmp_path / "lines.csv.bak")
    work = Working(project)
    (message,) = work.tables.messages
    assert message.code == "table-missing"
    assert message.text.startswith("lines.csv, which the project names, is not there")
    work.tables.close()


@pytest.mark.parametrize("tables_written", range(4))
def test_a_kill_between_two_tables_loses_and_doubles_nothing(
    project: Path, monkeypatch: pytest.MonkeyPatch, tables_written: int
) -> None:
    class Killed(BaseException):
        pass

    work = Working(project)
    for command in every_command():
        work.do(command)
    written = 0
    real = Tables._write

    def write(self: Tables, role: str, content: bytes | None) -> None:
        nonlocal written
        if written == tables_written:
            raise Killed
        real(self, role, content)
        written += 1

    monkeypatch.setattr(Tables, "_write", write)
    if tables_written == 3:
        monkeypatch.setattr(Journal, "record_save", lambda _: (_ for _ in ()).throw(Killed()))
    with pytest.raises(Killed):
        work.save()
    monkeypatch.undo()
    work.tables._lock.release()  # as the end of a process does

    again = Working(project)
    assert again.session.state == work.session.state
    assert again.save() == ""
    again.tables.close()
    last = Working(project)
    assert last.tables.recovered is None
    assert last.session.state == work.session.state
    last.tables.close()


def test_a_second_page_is_refused_and_the_first_one_named(project: Path) -> None:
    with (
        running(project) as server,
        pytest.raises(RefusedToStartError, match=f"process {server.pid}"),
    ):
        Server(project)
    with running(project):
        pass


def test_a_lock_that_a_kill_left_behind_is_no_lock(project: Path, tmp_path: Path) -> None:
    server = Server(project)
    server.kill()
    assert (tmp_path / "out" / LOCK).read_text() == f"{server.pid}\n"
    with running(project) as again:
        assert (tmp_path / "out" / LOCK).read_text() == f"{again.pid}\n"
    assert not (tmp_path / "out" / LOCK).exists()


def test_a_lock_is_told_by_the_system_not_by_a_number_in_a_file(tmp_path: Path) -> None:
    (tmp_path / LOCK).write_text(f"{os.getpid()}\n")  # alive, but it holds no lock
    lock = ProjectLock(tmp_path, "project.yaml")
    with pytest.raises(UavgramError, match=f"process {os.getpid()}"):
        ProjectLock(tmp_path, "project.yaml")
    lock.release()
    ProjectLock(tmp_path, "project.yaml").release()


def test_a_table_that_changed_while_the_project_was_read_is_no_start(
    project: Path, tmp_path: Path
) -> None:
    inputs = read_inputs(project, unfinished=True)
    (tmp_path / "picks.csv").write_bytes(PICKS + b"\r\n,Z,,P2.jpg,7,8")
    with pytest.raises(InputError, match="start again"):
        Tables(inputs)
    Working(project).tables.close()  # the lock was let go


def test_a_link_stays_a_link_and_its_rights_stay(project: Path, tmp_path: Path) -> None:
    (tmp_path / "store").mkdir()
    real = tmp_path / "store" / "p.csv"
    (tmp_path / "picks.csv").rename(real)
    (tmp_path / "picks.csv").symlink_to(real)
    real.chmod(0o640)
    work = Working(project)
    work.do(next(every_command()))
    assert work.save() == ""
    work.tables.close()
    assert (tmp_path / "picks.csv").is_symlink()
    assert b"11.0" in real.read_bytes()
    assert real.stat().st_mode & 0o777 == 0o640


def test_a_table_that_cannot_be_written_is_said_and_nothing_is_lost(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = files(tmp_path)
    work = Working(project)
    work.do(next(every_command()))
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert "picks.csv cannot be written (Permission denied)" in work.save()
    assert files(tmp_path) == before
    monkeypatch.undo()
    assert work.save() == ""
    assert files(tmp_path) != before
    work.tables.close()


def test_a_table_that_the_project_does_not_name_is_said(tmp_path: Path) -> None:
    project = small_project(tmp_path)
    text = project.read_text(encoding="utf-8").replace("lines: lines.csv\n", "")
    project.write_text(text, encoding="utf-8")
    work = Working(project)
    work.do(c.SetLine(was="", name="L", start="A", end="B", length_m=2.0, sigma_m=0.1, adjust=True))
    assert "`lines: lines.csv`" in work.save()
    work.tables.close()
    assert (
        b"L,A,B,2,0.1" in (tmp_path / "lines.csv").read_bytes()
        or b"2.0" in (tmp_path / "lines.csv").read_bytes()
    )


PLACE = c.Place(image="P1.jpg", label="A", u_px=1.1, v_px=2.2)


def journal_with(path: Path, *commands: Command) -> None:
    journal = Journal(path, fresh=True)
    journal.open(State(), {"picks": None}, resumed=False)
    for command in commands:
        journal.record(command, 0)
    journal.close()


def picks_in(path: Path) -> tuple[Pick, ...]:
    session = load_journal(path).session
    assert session is not None
    return session.state.picks


def test_a_line_that_a_kill_cut_off_was_never_confirmed(tmp_path: Path) -> None:
    path = tmp_path / JOURNAL
    journal_with(path, PLACE, c.Rename(label="A", new="B"))
    whole = path.read_bytes()
    second = whole.rindex(b"\n", 0, -1) + 1
    expected = (Pick(image="P1.jpg", label="A", u_px=1.1, v_px=2.2),)
    for end in range(second, len(whole)):
        path.write_bytes(whole[:end])
        assert picks_in(path) == expected
        journal = Journal(path, fresh=False)  # who goes on does not write behind half a line
        journal.record(c.Unpick(image="P1.jpg", label="A"), 0)
        journal.close()
        assert picks_in(path) == ()


def test_a_full_disk_is_told_before_anything_is_confirmed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / JOURNAL
    journal = Journal(path, fresh=True)
    journal.open(State(), {"picks": None}, resumed=False)
    journal.record(PLACE, 0)
    whole = path.read_bytes()
    real = os.write

    def full(handle: int, data: bytes) -> int:
        if len(data) > 10:
            return real(handle, data[:10])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(UavgramError, match="No space left"):
        journal.record(PLACE, 0)
    monkeypatch.undo()
    assert path.read_bytes() == whole
    journal.record(PLACE, 0)
    journal.close()
    assert len(picks_in(path)) == 1


def test_looking_at_a_project_writes_nothing(project: Path) -> None:
    before = sorted(project.parent.rglob("*"))
    work = Working(project)
    assert work.save() == ""
    work.tables.close()
    assert sorted(path for path in project.parent.rglob("*") if path.name != "out") == before


def test_what_cannot_be_kept_is_not_done_and_its_numbers_are_taken_back(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    survey = LiveSurvey.open(project)
    tables = Tables(survey.inputs)
    session = PickSession(survey, tables, lambda _: None)
    before = session.state
    adjusted: list[Task] = []
    monkeypatch.setattr(session._live, "submit", adjusted.append)

    def full(*_: object) -> Never:
        raise OutputError("No space left on device")

    monkeypatch.setattr(tables, "record", full)
    with pytest.raises(OutputError, match="No space left"):
        session.change(Message(seq=1, step=0, final=True, body=PLACE))
    assert session.state is before
    assert [task.state == before for task in adjusted] == [False, True]
    assert session.version == adjusted[1].version > adjusted[0].version
    session.saver.close()


@pytest.mark.parametrize(
    ("line", "taken"),
    [
        (b"", True),  # what the others differ from
        (b"not json\n", False),
        (b"[1]\n", False),
        (b'{"do": "Explode", "step": 0}\n', False),
        (b'{"do": "Unpick", "step": 0}\n', False),
        (b'{"do": "Unpick", "step": 0, "image": "P1.jpg", "label": "nobody"}\n', False),
        (b'{"do": "open", "state": 3}\n', False),
    ],
)
def test_a_journal_that_is_none_is_put_aside_and_said(
    project: Path, tmp_path: Path, *, line: bytes, taken: bool
) -> None:
    lost = Working(project)
    lost.do(PLACE)
    lost.tables.close()
    with (tmp_path / "out" / JOURNAL).open("ab") as stream:
        stream.write(line)
    work = Working(project)
    assert (work.tables.recovered is not None) == taken
    codes = [message.code for message in work.tables.messages]
    assert codes == ["pick-recovered" if taken else "pick-not-recovered"]
    assert len(list((tmp_path / "out").glob("pick-journal-*.jsonl"))) == (not taken)
    work.tables.close()


def test_heights_that_were_confirmed_outlive_a_kill_and_are_written(
    project: Path, tmp_path: Path
) -> None:
    lost = Working(project)
    for label in "QRS":
        lost.do(c.Place(image="P2.jpg", label=label, u_px=1.0, v_px=2.0))
    lost.do(c.SetHeight(label="Q", height_m=None, is_free=True))
    lost.do(c.SetHeight(label="R", height_m=1.4, height_sigma_m=0.02))
    lost.tables.close()
    journal = tmp_path / "out" / JOURNAL
    with journal.open("a") as stream:  # as versions wrote it that knew no sigma and no free height
        stream.write('{"do": "SetHeight", "step": 0, "label": "S", "height_m": 0.5}\n')
    work = Working(project)
    assert work.tables.recovered is not None
    assert work.tables.save(work.tables.recovered) == ""
    work.tables.close()
    picks = read_inputs(project, unfinished=True).picks
    row = {label: i for i, label in enumerate(picks.label)}
    assert picks.is_free[row["Q"]]
    assert (picks.height_m[row["R"]], picks.height_sigma_m[row["R"]]) == (1.4, 0.02)
    assert picks.height_m[row["S"]] == 0.5
    assert np.isnan(picks.height_sigma_m[row["S"]])
    assert picks.is_free.sum() == 1


LENGTH = partial(c.SetLine, was="", name="N", start="A", end="B", sigma_m=0.1, adjust=True)
SKID = partial(c.SetMeasurement, was="", name="S", kind="skid_speed", points=("A", "B"))


@pytest.mark.parametrize(
    ("command", "fault"),
    [
        (c.SetSigma(image="P1.jpg", label="A", sigma_px=1e-9), "sigma_px must lie between"),
        (c.Place(image="P1.jpg", label="A", u_px=5e10, v_px=1), "far too large"),
        (c.Place(image="P1.jpg", label="A;B", u_px=5, v_px=1), "semicolon"),
        (c.SetHeight(label="A", height_m=-2e10), "far too large"),
        (LENGTH(length_m=-2.0), "length_m must be greater than 0"),
        (SKID(parameters=(("mu", 0.5), ("mu_sigma", -1.0))), "mu_sigma"),
        # as a forged journal might
        (c.Place(image="P1.jpg", label="A", u_px="many", v_px=1), "many"),  # type: ignore[arg-type]
    ],
)
def test_a_journal_with_what_no_table_may_hold_leaves_the_project_readable(
    project: Path, command: Command, fault: str
) -> None:
    """A damaged or forged journal, or one of a program that had other limits."""
    before = Working(project)
    before.do(c.Place(image="P2.jpg", label="Q", u_px=1.0, v_px=2.0))
    before.do(command)
    before.tables.close()
    held = files(project.parent)
    after = Working(project)
    (message,) = after.tables.messages
    assert message.code == "pick-not-recovered"
    assert fault in message.text
    assert message.text.count("/") == message.text.partition("kept in ")[2].count("/")
    assert after.save() == ""
    after.tables.close()
    assert files(project.parent) == held
    read_inputs(project, unfinished=True)
    assert list((project.parent / "out").glob("pick-journal-*"))  # offered on the page


def test_ctrl_c_ends_the_command_with_everything_saved(tmp_path: Path) -> None:
    """The command itself, as a person starts it."""
    project = small_project(tmp_path)
    process = subprocess.Popen(
        [sys.executable, "-m", "uavgram", "pick", str(project), "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        address = process.stdout.readline().split(": ", 1)[1].strip()
        server = Server.__new__(Server)
        server.address, server.pid = address, process.pid
        with Page(server) as page:
            page.do("place", image=0, label="A", u_px=1.5, v_px=2.5)
            process.send_signal(2)
            _, said = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130
    assert said == "uavgram: ended; everything is saved\n"
    assert b"P1.jpg,A,1.5,2.5," in (tmp_path / "picks.csv").read_bytes()
    entries = (tmp_path / "out" / JOURNAL).read_text().splitlines()
    assert json.loads(entries[-1])["do"] == "saved"


HEIC = b"\x00\x00\x00\x18ftypheic" + bytes(100)


def test_new_files_beside_the_photos_are_named_with_the_way_out(project: Path) -> None:
    photos = project.parent / "photos"
    watch = FileWatch(read_inputs(project))
    assert not watch.find_changed_files()
    assert not watch.added
    (photos / "notes.txt").write_text("no photo")
    watch.find_changed_files()
    assert not watch.added
    (photos / "DJI_1.HEIC").write_bytes(HEIC)
    (photos / "P7.jpg").write_bytes(b"\xff\xd8\xff no picture")
    (photos / "P8.jpg").write_bytes((photos / "P1.jpg").read_bytes())
    assert not watch.find_changed_files()
    assert "New beside the photos: DJI_1.HEIC. Passed over: 1 x HEIC photo." in watch.added
    assert "save it as JPEG" in watch.added
    assert "P7.jpg is new, and cannot be used, as it" in watch.added
    assert "New beside the photos: P8.jpg. Reload takes new photos into" in watch.added
    for name in ("DJI_1.HEIC", "P7.jpg", "P8.jpg"):
        (photos / name).unlink()
    watch.find_changed_files()
    assert not watch.added


def test_a_folder_that_is_gone_is_said_and_not_made_again(project: Path, tmp_path: Path) -> None:
    work = Working(project)
    watch = FileWatch(read_inputs(project))
    work.do(c.Place(image="P1.jpg", label="C", u_px=5.0, v_px=5.0))
    before = work.session.state
    moved = tmp_path.with_name(f"{tmp_path.name} moved")
    tmp_path.rename(moved)
    assert f"The folder {tmp_path} is gone: it was moved" in work.save()
    with pytest.raises(OutputError, match="is gone"):
        work.do(c.Place(image="P1.jpg", label="D", u_px=6.0, v_px=6.0))
    work.session = replace(work.session, state=before)
    assert watch.find_changed_files(("picks.csv",)) == []
    assert "put the folder back under its name" in watch.added
    assert not tmp_path.exists()
    moved.rename(tmp_path)
    assert not watch.find_changed_files()
    assert not watch.added
    assert not work.save()
    assert b"C" in (tmp_path / "picks.csv").read_bytes()
