"""Suggestions in messages."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

from uavgram.errors import install_command, suggest_spelling


@pytest.mark.parametrize(
    ("word", "known", "suggested"),
    [
        ("r1", ["R1", "R2"], "R1"),
        ("P01", ["P1", "P10"], "P1"),
        ("kerb nord", ["kerb north", "kerb south"], "kerb north"),
        ("IMG_0003.JPG", ["IMG_0003.jpg", "IMG_0004.jpg"], "IMG_0003.jpg"),
        ("heigth_m", ["height_m", "length_m"], "height_m"),
        ("skid", ["R1"], None),
    ],
)
def test_a_near_miss_is_a_spelling_of_the_same_thing(
    word: str, known: list[str], suggested: str | None
) -> None:
    assert suggest_spelling(word, known) == (f"did you mean {suggested!r}?" if suggested else "")


def test_a_missing_package_is_installed_as_the_program_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    assert install_command("x") == f'"{sys.executable}" -m pip install x'
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert install_command("x") == f'uv pip install --python "{sys.executable}" x'
    (tmp_path / "pipx_metadata.json").write_text("{}")
    assert install_command("x") == "pipx inject uavgram x"
