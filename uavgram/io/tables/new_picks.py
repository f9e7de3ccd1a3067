"""New picks.csv and control.csv; a file that is there is never written over."""

from __future__ import annotations

from pathlib import Path

from uavgram.errors import InputError
from uavgram.io.outputs import replace_text
from uavgram.io.tables.csv_rows import csv_text
from uavgram.io.tables.spreadsheet_cells import guarded
from uavgram.model.survey.imported import ImportedPicks
from uavgram.model.survey.observations import KnownPoints


def write_new_picks(picks: ImportedPicks, path: Path) -> None:
    """Write picks.csv.

    Raises
    ------
    InputError
        The file is there already.
    OutputError
        It cannot be written.
    """
    rows = [
        [guarded(image), guarded(label), repr(float(u)), repr(float(v))]
        for image, label, (u, v) in zip(picks.image, picks.label, picks.pixel_px, strict=True)
    ]
    _write_new(path, ["image", "label", "u_px", "v_px"], rows)


def write_new_control(known: KnownPoints, path: Path) -> None:
    """Write control.csv with geodetic coordinates; errors as for `write_new_picks`."""
    header = ["label", "latitude_deg", "longitude_deg", "height_m"]
    header += ["sigma_east_m", "sigma_north_m", "sigma_up_m"]
    rows = [
        [guarded(label), *(repr(float(value)) for value in (*place, *sigma))]
        for label, place, sigma in zip(known.label, known.coordinates, known.sigma_m, strict=True)
    ]
    _write_new(path, header, rows)


def _write_new(path: Path, header: list[str], rows: list[list[str]]) -> None:
    if path.exists():
        raise InputError(path, "is there already: name another file, or move this one away")
    replace_text(path, csv_text(header, rows))
