from __future__ import annotations

import csv
from pathlib import Path

import pytest

from uavgram.io.exports.measurements_csv import round_by_sigma, write_measurements_csv
from uavgram.model.result.result import Result

INTERVAL = ("20.00000", "20.25000")


def test_the_table_holds_the_measurements_with_empty_cells_for_what_is_not_known(
    sample_result: Result, tmp_path: Path
) -> None:
    write_measurements_csv(sample_result, tmp_path / "m.csv")
    with (tmp_path / "m.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))

    assert ",".join(rows[0]) == (
        "name,kind,points,value,sigma,unit,lower_95,upper_95,alternatives,"
        "shift_relief_10cm,shift_tape_1pct,sigma_stated,status,picked_by"
    )
    assert rows[1] == [
        "m, long",
        "distance",
        "P;R",
        "20.12500",
        "0.05000",
        "m",
        *INTERVAL,
        "",
        "",
        "",
        "0.05000",
        "ok",
        "hand",
    ]
    assert rows[5] == ["q", "skid_speed", "P;Z", "", "", "m/s", *[""] * 6, "not-checked", "hand"]
    assert len(rows) == 7


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (16.935738904988817, 0.012561130925518223, "16.93574"),
        (31.931318995475017, 2.0159392658633863, "31.931"),
        (123456.789, 54321.0, "123457"),
        (123456.789, 987.6, "123456.8"),
        (0.000123456789, 2e-7, "0.0001234568"),
        (-1.0, 9.9e-5, "-1.00000000"),
        (12.5, 0.0, "12.5"),
        (12.5, float("nan"), "12.5"),
        (float("nan"), 1.0, ""),
    ],
)
def test_a_number_has_two_digits_more_than_its_sigma_deserves(
    value: float, sigma: float, text: str
) -> None:
    assert round_by_sigma(value, sigma) == text
