"""The output folder: results appear complete, or not at all."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from copy import copy
from pathlib import Path
from typing import Any

import pytest

from uavgram.errors import OutputError
from uavgram.io.outputs import (
    PREFIX,
    SupersededError,
    claim_folder,
    replace_bytes,
    replace_text,
    stage_output,
)


def content(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): path.read_text()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture
def earlier(tmp_path: Path) -> Path:
    """An output folder with the results of an earlier run, and a file of someone else."""
    folder = tmp_path / "out"
    (folder / "previews").mkdir(parents=True)
    for name in ("results.json", "report.html", "previews/a.png", "notes.txt"):
        (folder / name).write_text("old")
    return folder


def run_and_fail(folder: Path, failure: BaseException | type[BaseException]) -> None:
    with stage_output(folder) as staging:
        write_all(staging)
        raise failure


def write_all(staging: Path) -> None:
    (staging / "previews").mkdir()
    for name in ("results.json", "report.html", "previews/a.png", "added.csv"):
        (staging / name).write_text("new")


def test_complete_results_replace_earlier_ones_and_leave_other_files(earlier: Path) -> None:
    with stage_output(earlier) as staging:
        write_all(staging)
        assert set(content(earlier).values()) >= {"old"}
        assert (earlier / "results.json").read_text() == "old"

    names = ("results.json", "report.html", "previews/a.png", "added.csv")
    assert content(earlier) == {**dict.fromkeys(names, "new"), "notes.txt": "old"}


def test_a_new_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    with stage_output(tmp_path / "a" / "b") as staging:
        write_all(staging)

    assert (tmp_path / "a" / "b" / "results.json").read_text() == "new"


@pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_a_failed_run_leaves_everything_as_it_was(
    earlier: Path, failure: type[BaseException]
) -> None:
    before = content(earlier)

    with pytest.raises(failure):
        run_and_fail(earlier, failure)
    assert content(earlier) == before
    assert not list(earlier.glob(".*"))


def test_a_failed_first_run_leaves_no_folder(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError):
        run_and_fail(tmp_path / "out", RuntimeError)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("step", ["fsync", "replace"])
@pytest.mark.parametrize("done", [0, 2, 3])
def test_a_first_run_that_ends_while_files_are_moved_leaves_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, done: int
) -> None:
    at, count = (os, os.fsync) if step == "fsync" else (Path, Path.replace), list[int]()

    def ends(*given: Any) -> object:  # noqa: ANN401 (a number, or paths)
        count.append(1)
        if len(count) > done:
            raise KeyboardInterrupt
        return at[1](*given)

    monkeypatch.setattr(at[0], step, ends)
    with pytest.raises(KeyboardInterrupt), stage_output(tmp_path / "out") as staging:
        write_all(staging)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("failure", [OSError(errno.EIO, "I/O"), KeyboardInterrupt()])
@pytest.mark.parametrize("moves", [0, 1, 3])
def test_a_failure_while_moving_undoes_what_was_moved(
    earlier: Path, monkeypatch: pytest.MonkeyPatch, failure: BaseException, moves: int
) -> None:
    before = content(earlier)
    move, count = Path.replace, list[Path]()

    def failing(self: Path, target: Path) -> Path:
        if "files" in self.parts:
            count.append(self)
            if len(count) > moves:
                raise failure
        return move(self, target)

    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(type(failure)), stage_output(earlier) as staging:
        write_all(staging)
    assert content(earlier) == before


def test_results_json_is_moved_last(earlier: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    move, order = Path.replace, list[str]()

    def noted(self: Path, target: Path) -> Path:
        order.append(target.name)
        return move(self, target)

    monkeypatch.setattr(Path, "replace", noted)
    with stage_output(earlier) as staging:
        write_all(staging)
        (staging / "zzz.txt").touch()

    assert len(order) == 5
    assert order[-1] == "results.json"


def test_a_folder_in_the_place_of_a_file_is_an_output_error(earlier: Path) -> None:
    (earlier / "added.csv").mkdir()
    before = content(earlier)

    with pytest.raises(OutputError, match="--output"), stage_output(earlier) as staging:
        write_all(staging)
    assert content(earlier) == before


def test_a_file_in_the_place_of_the_folder_is_an_output_error(tmp_path: Path) -> None:
    (tmp_path / "out").touch()

    with pytest.raises(OutputError, match="choose another folder"), stage_output(tmp_path / "out"):
        pass
    with pytest.raises(OutputError), stage_output(tmp_path / "out" / "deeper"):
        pass


def test_a_full_disk_is_an_output_error_with_the_way_out(earlier: Path) -> None:
    before = content(earlier)

    with pytest.raises(OutputError, match="disk is full; free some space"):
        run_and_fail(earlier, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    assert content(earlier) == before


def test_a_failure_elsewhere_keeps_its_own_name(earlier: Path, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), stage_output(earlier):
        (tmp_path / "absent.jpg").read_bytes()


def test_what_a_killed_run_left_goes_when_the_next_starts_but_a_living_run_stays(
    earlier: Path,
) -> None:
    script = (
        "import sys, time\n"
        "from uavgram.io.outputs import stage_output\n"
        "with stage_output(sys.argv[1]) as staging:\n"
        "    (staging / 'half').write_text('x')\n"
        "    print('ready', flush=True)\n"
        "    time.sleep(60)\n"
    )
    command = [sys.executable, "-c", script, str(earlier)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as run:
        assert run.stdout is not None
        assert run.stdout.readline() == b"ready\n"
        with stage_output(earlier):
            assert len(list(earlier.glob(f"{PREFIX}*"))) == 2  # ours, and the living one
        run.send_signal(signal.SIGKILL)
    (left,) = earlier.glob(f"{PREFIX}*")
    assert (earlier / "results.json").read_text() == "old"

    with stage_output(earlier):
        assert not left.exists()


KILLED_WHILE_MOVING = """
import os, signal, sys
from pathlib import Path
from uavgram.io.outputs import stage_output
move, moved = Path.replace, []
def replace(path, target):
    if "files" in path.parts:
        if len(moved) == int(sys.argv[2]):
            os.kill(os.getpid(), signal.SIGKILL)
        moved.append(path)
    return move(path, target)
Path.replace = replace
with stage_output(sys.argv[1]) as staging:
    (staging / "previews").mkdir()
    for name in ("results.json", "report.html", "previews/a.png", "added.csv"):
        (staging / name).write_text("new")
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("moves", [0, 1, 3, 4])
def test_what_a_killed_run_had_moved_is_put_back_unless_it_was_everything(
    earlier: Path, moves: int
) -> None:
    before = content(earlier)
    command = [sys.executable, "-c", KILLED_WHILE_MOVING, str(earlier), str(moves)]
    assert subprocess.run(command, check=False).returncode == -signal.SIGKILL
    with stage_output(earlier):
        pass
    assert not list(earlier.glob(".*"))
    if moves < 4:
        assert content(earlier) == before
    else:
        assert content(earlier) == {
            **dict.fromkeys([*before, "added.csv"], "new"),
            "notes.txt": "old",
        }


def test_no_output_is_written_over_an_input(earlier: Path) -> None:
    before = content(earlier)
    with (
        pytest.raises(OutputError, match=r"report\.html: is an input.*--output"),
        stage_output(earlier, [earlier / "previews" / ".." / "report.html"]) as staging,
    ):
        write_all(staging)
    assert content(earlier) == before


def test_text_is_replaced_in_one_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "results.json"
    replace_text(path, "old ü\n")
    monkeypatch.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(OSError(28, "full")))

    with pytest.raises(OutputError, match="disk is full"):
        replace_text(path, "new")
    assert path.read_bytes() == "old ü\n".encode()
    assert [p.name for p in tmp_path.iterdir()] == ["results.json"]


def test_files_have_the_permissions_of_any_new_file(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    with stage_output(tmp_path / "out") as staging:
        replace_text(staging / "results.json", "x")

    modes = {(tmp_path / name).stat().st_mode for name in ("plain", "out/results.json")}
    assert len(modes) == 1


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> set[Path]:
    """Files that another program has open, as Excel does on Windows: nothing replaces them."""
    move, held = Path.replace, set[Path]()

    def refusing(self: Path, target: Path) -> Path:
        if target in held:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), self, None, target)
        return move(self, target)

    monkeypatch.setattr(Path, "replace", refusing)
    return held


def test_a_result_that_is_open_elsewhere_is_written_beside_it_and_the_next_run_tidies_up(
    earlier: Path, held: set[Path], caplog: pytest.LogCaptureFixture
) -> None:
    held |= {earlier / "report.html", earlier / "results.json"}
    before = content(earlier)
    with stage_output(earlier) as staging:
        write_all(staging)
    assert content(earlier) == before | {
        "previews/a.png": "new",
        "added.csv": "new",
        "report.newer.html": "new",
        "results.newer.json": "new",
    }
    assert "report.html is open in another program" in caplog.text
    assert "the new one is report.newer.html" in caplog.text

    held.add(earlier / "results.newer.json")  # somebody looks at that one too
    with stage_output(earlier) as staging:
        write_all(staging)
    assert "results.newer-2.json" in content(earlier)

    held.clear()
    with stage_output(earlier) as staging:
        write_all(staging)
    names = ("results.json", "report.html", "previews/a.png", "added.csv")
    assert content(earlier) == {**dict.fromkeys(names, "new"), "notes.txt": "old"}


def test_what_was_written_beside_is_undone_too(
    earlier: Path, held: set[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    held.add(earlier / "report.html")
    (earlier / "report.newer.html").write_text("of the run before")
    before, move = content(earlier), Path.replace

    def failing(self: Path, target: Path) -> Path:
        if target == earlier / "results.json":
            raise OSError(errno.EIO, "I/O")
        return move(self, target)

    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(OSError, match="I/O"), stage_output(earlier) as staging:
        write_all(staging)
    assert content(earlier) == before


def test_a_file_that_is_open_elsewhere_is_named(tmp_path: Path, held: set[Path]) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text("old")
    held.add(path)

    with pytest.raises(OutputError, match=r"camera\.yaml may not be replaced; if another program"):
        replace_text(path, "new")
    assert content(tmp_path) == {"camera.yaml": "old"}


NAMES = ("a.csv", "b.html", "results.json")


def write(folder: Path, text: str, hold: Callable[[], None]) -> None:
    with stage_output(folder, hold=hold) as staging:
        for name in NAMES:
            (staging / name).write_text(text)


def found(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("second_is_done", [False, True])
def test_the_first_writes_nothing_once_a_second_began(
    tmp_path: Path, *, second_is_done: bool
) -> None:
    out = tmp_path / "out"
    with claim_folder(out) as first:
        with claim_folder(out) as second:
            if not second_is_done:
                with pytest.raises(SupersededError, match="another process"):
                    write(out, "first", first)
            write(out, "second", second)
        if second_is_done:
            with pytest.raises(SupersededError):
                write(out, "first", first)

    assert found(out) == dict.fromkeys(NAMES, "second")


@pytest.mark.parametrize("had_earlier", [False, True])
def test_a_first_that_was_stopped_while_it_moved_files_changes_none_when_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, had_earlier: bool
) -> None:
    out = tmp_path / "out"
    if had_earlier:
        with claim_folder(out) as earlier:
            write(out, "earlier", earlier)
    replace, moved = Path.replace, []

    def stopped_at_the_second(source: Path, target: Path) -> Path:
        moved.append(target.name)
        if len(moved) == 2:
            assert target.with_name("a.csv").read_text() == "first"
            with claim_folder(out) as second:
                write(out, "second", second)
        return replace(source, target)

    with claim_folder(out) as first:
        monkeypatch.setattr(Path, "replace", stopped_at_the_second)
        with pytest.raises(OutputError):
            write(out, "first", first)

    assert found(out) == dict.fromkeys(NAMES, "second")


def test_a_claim_leaves_nothing_behind(tmp_path: Path) -> None:
    with claim_folder(tmp_path / "a" / "out"):
        pass

    assert not (tmp_path / "a" / "out").exists()


def test_that_it_was_superseded_can_be_sent_from_a_worker() -> None:
    fault = SupersededError("/surveys/a/out")  # pickled as it is copied

    assert str(copy(fault)) == str(fault)


# Links in somebody's unpacked folder: nothing is written where they lead.


@pytest.fixture
def victim(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "elsewhere").mkdir()
    path = tmp_path / "elsewhere" / "victim"
    path.write_text("precious")
    yield path
    assert path.read_text() == "precious"
    assert [one.name for one in path.parent.iterdir()] == ["victim"]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    folder = tmp_path / "project" / "out"
    folder.mkdir(parents=True)
    return folder


def write_into(folder: Path, name: str) -> None:
    folder.mkdir()
    (folder / name).write_text("new")


def test_a_file_is_replaced_and_not_written_through_links(out: Path, victim: Path) -> None:
    (out / "a.csv").symlink_to(victim)
    (out / ".a.csv.unfinished").symlink_to(victim)
    replace_bytes(out / "a.csv", b"new")
    assert not (out / "a.csv").is_symlink()
    assert (out / "a.csv").read_bytes() == b"new"


def test_results_replace_links_and_folders_that_lead_elsewhere_are_refused(
    out: Path, victim: Path
) -> None:
    (out / "results.json").symlink_to(victim)
    with stage_output(out) as staging:
        (staging / "results.json").write_text("new")
    assert (out / "results.json").read_text() == "new"
    (out / "colmap").symlink_to(victim.parent)
    with (
        pytest.raises(OutputError, match=r"out/colmap: is a link that leads out.*remove the link"),
        stage_output(out) as staging,
    ):
        write_into(staging / "colmap", "victim")


@pytest.mark.parametrize("name", ["../../elsewhere/victim", "/{victim}", "over/victim"])
def test_what_looks_like_a_killed_run_moves_and_removes_nothing_elsewhere(
    out: Path, victim: Path, name: str
) -> None:
    """A hidden folder in an archive names files of its own choice as half moved."""
    stale = out / f"{PREFIX}forged"
    (stale / "files").mkdir(parents=True)
    (stale / "files" / "waits").write_text("x")
    (out / "over").symlink_to(victim.parent)
    (stale / "moving.txt").write_text(f"waits\n{name.format(victim=victim)}\n.")
    with stage_output(out) as staging:
        (staging / "results.json").write_text("new")
    assert not stale.exists()


@pytest.mark.parametrize("inside", ["files", "earlier", ""])
def test_a_forged_killed_run_takes_no_files_from_elsewhere(
    out: Path, victim: Path, inside: str
) -> None:
    stale = out / f"{PREFIX}forged"
    (stale if inside else out / "other").mkdir()
    for name in {"files", "earlier"} - {inside}:
        folder = (stale if inside else out / "other") / name
        folder.mkdir(parents=True)
        (folder / "waits").write_text("x")
    if inside:
        (stale / inside).symlink_to(victim.parent)
    else:
        stale.symlink_to(victim.parent)
    if inside:
        (stale / "moving.txt").write_text("waits\nvictim\n.")
    with stage_output(out) as staging:
        (staging / "results.json").write_text("new")
    assert not (out / "victim").exists()


def test_a_folder_that_holds_the_photos_takes_no_results(tmp_path: Path, out: Path) -> None:
    photos = tmp_path / "project" / "photos"
    photos.mkdir()
    photo = photos / "P1.jpg"
    photo.write_bytes(b"a photo")
    (out / "by-a-link").symlink_to(photos)
    for folder in (photos, out / "by-a-link", photos / ".." / "photos"):
        with (
            pytest.raises(OutputError, match="holds the photos themselves"),
            stage_output(folder, photos=[photo]),
        ):
            pass
    with (
        pytest.raises(OutputError, match="project/photos: holds the photos themselves"),
        stage_output(photos.parent, photos=[photo]) as staging,
    ):
        write_into(staging / "photos", "P2.jpg")
    assert os.listdir(photos) == ["P1.jpg"]  # noqa: PTH208
