"""Sentences that the page is sent, in the units of the project; numbers and names as they are."""

from __future__ import annotations

from uavgram.model.units import IMPERIAL, METRIC
from uavgram.picking.document.state import State
from uavgram.picking.protocol.encode_units import in_project_units, names_to_keep

MESSAGE = {
    "t": "live",
    "seconds": 0.4,
    "verdict": {
        "words": "off by 3.2 cm",
        "why": [{"text": "wall 4.10 m: 1.40 m high", "labels": ["P 4 m"], "mends": []}],
    },
    "lines": {"wall 4.10 m": {"adjusted_m": 4.1, "shows": "shows from 3.2 cm on"}},
    "diff": {"lines": [{"name": "x", "text": "1.40 m"}]},
    "messages": [{"level": "info", "text": "at 13.9 m/s"}],
}


def test_sentences_are_told_in_feet_and_nothing_else_is_changed() -> None:
    told = in_project_units(MESSAGE, IMPERIAL, ("wall 4.10 m",))

    assert told["verdict"]["words"] == "off by 1.26 in"
    assert told["verdict"]["why"][0]["text"] == "wall 4.10 m: 4 ft 7 in high"
    assert told["verdict"]["why"][0]["labels"] == ["P 4 m"]
    assert told["lines"] == {"wall 4.10 m": {"adjusted_m": 4.1, "shows": "shows from 1.26 in on"}}
    assert told["diff"] == MESSAGE["diff"]
    assert told["messages"][0]["text"] == "at 31.1 mph"


def test_in_metres_only_speeds_are_told_anew() -> None:
    told = in_project_units(MESSAGE, METRIC, ())

    assert told["messages"][0]["text"] == "at 50.0 km/h"
    assert {**told, "messages": MESSAGE["messages"]} == MESSAGE


def test_names_of_an_empty_project_need_no_care() -> None:
    assert names_to_keep(State()) == ()
