"""Types of messages for the page: those of the server's typed dictionaries and of the commands."""

from __future__ import annotations

import page_types


def declared(name: str) -> str:
    start = f"export interface {name} "
    return next(line for line in page_types.page_types().splitlines() if line.startswith(start))


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
