"""lines.csv: which tape, and what was measured; read, refused in plain words, and written back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from uavgram.errors import InputError
from uavgram.io.tables.known import read_lines
from uavgram.io.tables.updates import update_lines
from uavgram.picking.document import commands as c
from uavgram.picking.document.history import apply_change
from uavgram.picking.document.state import State, make_observations, make_state

TABLE = (
    "name,from,to,length_m,sigma_m,tape,along\n"
    "L1,A,B,11.5,0.01,red,horizontal\n"
    "L2,A,C,12.5,0.01,,\n"
)


def read(folder: Path, text: str) -> State:
    (folder / "lines.csv").write_text(text)
    lines = read_lines(folder / "lines.csv")
    assert lines.tape == ("red", "")
    assert lines.along == ("horizontal", "slope")
    none, _ = make_observations(State())
    return make_state(none, lines, ())


def test_tape_and_along_come_back_from_the_page_as_they_were(tmp_path: Path) -> None:
    state = read(tmp_path, TABLE)
    _, before = make_observations(state)
    change = c.SetLine(
        was="L1", name="L1", start="A", end="B", length_m=11.6, sigma_m=0.01, adjust=True
    )
    _, after = make_observations(apply_change(state, change))

    assert (after.tape, after.along) == (before.tape, before.along)
    assert update_lines(TABLE.encode(), before, after) == TABLE.replace("11.5", "11.6").encode()
    _, blue = make_observations(apply_change(state, replace(change, tape="blue", along="slope")))
    written = update_lines(TABLE.encode(), before, blue)
    assert written == TABLE.replace("11.5,0.01,red,horizontal", "11.6,0.01,blue,").encode()


def test_another_way_to_measure_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"along must be slope or horizontal \(got 'horizontl'\)"):
        read(tmp_path, TABLE.replace("horizontal", "horizontl"))
