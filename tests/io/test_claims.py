"""Of several processes that measure the same survey, the one that began last writes."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from pathlib import Path

import pytest

from uavgram.errors import OutputError
from uavgram.io.claims import SupersededError, claimed
from uavgram.io.outputs import staged_output

NAMES = ("a.csv", "b.html", "results.json")


def write(folder: Path, text: str, hold: Callable[[], None]) -> None:
    with staged_output(folder, hold=hold) as staging:
        for name in NAMES:
            (staging / name).write_text(text)


def found(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("second_is_done", [False, True])
def test_the_first_writes_nothing_once_a_second_began(
    tmp_path: Path, *, second_is_done: bool
) -> None:
    out = tmp_path / "out"
    with claimed(out) as first:
        with claimed(out) as second:
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
        with claimed(out) as earlier:
            write(out, "earlier", earlier)
    replace, moved = Path.replace, []

    def stopped_at_the_second(source: Path, target: Path) -> Path:
        moved.append(target.name)
        if len(moved) == 2:
            assert target.with_name("a.csv").read_text() == "first"
            with claimed(out) as second:
                write(out, "second", second)
        return replace(source, target)

    with claimed(out) as first:
        monkeypatch.setattr(Path, "replace", stopped_at_the_second)
        with pytest.raises(OutputError):
            write(out, "first", first)

    assert found(out) == dict.fromkeys(NAMES, "second")


def test_a_claim_leaves_nothing_behind(tmp_path: Path) -> None:
    with claimed(tmp_path / "a" / "out"):
        pass

    assert not (tmp_path / "a" / "out").exists()


def test_that_it_was_superseded_can_be_sent_from_a_worker() -> None:
    fault = SupersededError("/surveys/a/out")  # pickled as it is copied

    assert str(copy(fault)) == str(fault)
