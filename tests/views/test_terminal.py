"""Plain text for the terminal."""

from __future__ import annotations

import numpy as np
import synthetic_survey as survey

from uavgram.model.observations import Picks
from uavgram.stages.match import Matches, Record
from uavgram.views.terminal import match_lines, measurement_table, message_lines


def test_the_table_lists_every_measurement_worst_first_in_straight_columns() -> None:
    result = survey.build()
    header, rule, *rows = measurement_table(result).splitlines()

    assert len(rows) == len(result.measurements.name)
    assert rows[0].startswith("to the tree")
    # Its value, and its status: nothing says of what there is not that it was not checked.
    assert rows[0].count("not computed") == 2
    assert rows[-1].startswith("skid left")
    assert "39.612 ± 0.021 m" in rows[-1]
    status = header.index("status")
    assert all(row[status - 1 : status + 1].split() == [row[status]] for row in rows)
    assert len(rule) == max(map(len, rows))


def test_without_measurements_the_table_says_so() -> None:
    assert measurement_table(survey.build(measures=())).startswith("No measurements were requested")


def test_errors_come_before_warnings_before_choices() -> None:
    levels = [line.split(":")[0] for line in message_lines(survey.build().messages)]

    assert levels == ["error", "warning", "info"]


def test_each_message_ends_with_its_code() -> None:
    messages = survey.build().messages

    assert sorted(line.rsplit(" [")[1] for line in message_lines(messages)) == sorted(
        f"{message.code}]" for message in messages
    )


# What a search for picks came to, in words.


def nothing(turned_rad: float) -> Matches:
    none = np.zeros(0)
    picks = Picks(
        image=(),
        label=(),
        pixel_px=np.zeros((0, 2)),
        sigma_px=none,
        height_m=none,
        height_sigma_m=none,
    )
    return Matches(
        path="picks.csv", record=Record(), labels=(), picks=picks, replaced=0, turned_rad=turned_rad
    )


def test_a_log_that_contradicts_the_photos_is_told_and_what_to_do() -> None:
    told = " ".join(match_lines(nothing(float(np.deg2rad(14.2)))))
    assert "some 14 degrees away from its direction by the flight log and `mount`" in told
    assert "`ties: auto`" in told
    assert "--undo" in told


def test_it_is_not_told_of_a_log_that_fits() -> None:
    assert "degrees" not in " ".join(match_lines(nothing(0.0)))
