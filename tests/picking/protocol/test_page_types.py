"""Types of messages for the page: those of the server's typed dictionaries and of the commands."""

from __future__ import annotations

from pathlib import Path

import page_types
import pytest


def declared(name: str) -> str:
    start = f"export interface {name} "
    return next(line for line in page_types.page_types().splitlines() if line.startswith(start))


def test_the_file_of_the_page_is_what_the_server_declares() -> None:
    assert page_types.main(["--check"]) == 0


def test_a_file_that_differs_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(page_types, "PATH", tmp_path / "protocol.d.ts")
    assert page_types.main([]) == 0
    assert page_types.main(["--check"]) == 0
    page_types.PATH.write_text("export {};\n", encoding="utf-8")

    assert page_types.main(["--check"]) == 1
    assert "protocol.d.ts" in capsys.readouterr().err


def test_texts_of_numbers_are_text_and_fields_may_be_absent() -> None:
    assert "{ text: string; grade: string; earth: string }" in declared("ValueWords")
    assert "source?: Source;" in declared("Pick")
    assert "points: Record<string, AdjustedPoint | undefined>;" in declared("Adjusted")
    assert "why?: undefined;" in declared("Snapped")


def test_commands_have_photos_as_numbers_and_defaults_may_be_absent() -> None:
    place, swap = declared("Place"), declared("Swap")
    assert 't: "place"' in place
    assert "image: number; label: string; u_px: number;" in place
    assert "sigma_px?: number | null;" in place
    assert "image: number | null;" in swap
    assert "pairs: [number, string][]" in declared("Accept")
