"""`uavgram explain`: one entry, the list of all, a code that does not exist."""

from __future__ import annotations

import pytest
from small_projects import Command

from uavgram.model.message_catalogue import entries_by_code


def test_an_entry_states_finding_effect_and_action(command: Command) -> None:
    done = command("explain", "labels-swapped")

    assert (done.status, done.stderr) == (0, "")
    assert done.stdout.splitlines()[0] == "labels-swapped: warning"
    for part in ("Finding:     In one photo", "Verdict:     At best amber", "Action:      Swap"):
        assert f"\n{part}" in done.stdout
    assert max(map(len, done.stdout.splitlines())) < 80
    assert command("explain", "[labels-swapped]").stdout == done.stdout  # as it was printed
    assert command("explain", "Labels-Swapped").stdout == done.stdout  # in either case


def test_without_a_code_all_are_listed_with_one_line_each(command: Command) -> None:
    lines = command("explain").stdout.splitlines()
    listed = [line.split()[0] for line in lines if line.startswith("  ")]

    assert listed == list(entries_by_code())


@pytest.mark.parametrize(
    ("typed", "near"),
    [("picks-suspect", "pick-suspect"), ("label-swapped", "labels-swapped"), ("Misfits", "misfit")],
)
def test_an_unknown_code_names_the_nearest(command: Command, typed: str, near: str) -> None:
    done = command("explain", typed)

    assert (done.status, done.stdout) == (1, "")
    assert done.stderr.count("\n") == 1
    assert f"The nearest codes: {near}" in done.stderr


def test_a_code_like_no_other_still_leads_to_the_list(command: Command) -> None:
    done = command("explain", "nonsense")

    assert done.status == 1
    assert "`uavgram explain` lists all codes" in done.stderr
    assert "nearest" not in done.stderr
