from __future__ import annotations

import csv

from uavgram.io.measurements_csv import write_measurements_csv


def test_the_table_holds_the_measurements_with_empty_cells_for_what_is_not_known(
    sample_result, tmp_path
):
    write_measurements_csv(sample_result, tmp_path / "m.csv")
    with (tmp_path / "m.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))

    assert ",".join(rows[0]) == "name,kind,points,value,sigma,unit,lower_95,upper_95,alternatives"
    assert rows[1] == ["m, long", "distance", "P;R", "20.125", "0.05", "m", "20.0", "20.25", ""]
    assert rows[5] == ["q", "skid_speed", "P;Z", "", "", "m/s", "", "", ""]
    assert len(rows) == 7
