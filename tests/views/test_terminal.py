"""Plain text for the terminal."""

from __future__ import annotations

import synthetic_survey as survey

from uavgram.views.terminal import measurement_table, message_lines


def test_the_table_lists_every_measurement_worst_first_in_straight_columns() -> None:
    result = survey.build()
    header, rule, *rows = measurement_table(result).splitlines()

    assert len(rows) == len(result.measurements.name)
    assert rows[0].startswith("to the tree")
    # Its value, and its status: nothing says of what there is not that it was not checked.
    assert rows[0].count("not computed") == 2
    assert rows[-1].startswith("skid left")
    assert "39.612 ± 0.021 m" in rows[-1]
    assert {len(row) for row in rows} == {len(rule)} == {len(header)}


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
