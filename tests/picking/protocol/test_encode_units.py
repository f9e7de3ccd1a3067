"""Sentences that the page is sent, in the units of the project; numbers and names as they are."""

from __future__ import annotations

from uavgram.model.naming import FOOT_M, IMPERIAL, METRIC, Units
from uavgram.picking.document.state import Line, State
from uavgram.picking.protocol.encode_units import collect_lengths, convert_units, list_kept_names

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
    told = convert_units(MESSAGE, IMPERIAL, ("wall 4.10 m",))

    assert told["verdict"]["words"] == "off by 1.26 in"
    assert told["verdict"]["why"][0]["text"] == "wall 4.10 m: 4 ft 7 in high"
    assert told["verdict"]["why"][0]["labels"] == ["P 4 m"]
    assert told["lines"] == {"wall 4.10 m": {"adjusted_m": 4.1, "shows": "shows from 1.26 in on"}}
    assert told["diff"] == MESSAGE["diff"]
    assert told["messages"][0]["text"] == "at 31.1 mph"


def test_sentences_tell_what_was_typed_and_not_what_its_rounded_metres_are() -> None:
    """10.5 ft are 3.2004 m, which a sentence tells as 3.200 m: 10.499 ft."""
    line = Line(name="L1", start="A", end="B", length_m=10.5 * FOOT_M, sigma_m=0.01)
    state = State(lines=(line,))
    message = {
        "mode": "adjusted",
        "lines": {"L1": {"adjusted_m": 10.53 * FOOT_M, "unit": "m"}},
        "measurements": {"D1": {"value": 7.25 * FOOT_M, "sigma": None, "unit": "m"}},
        "why": [
            {"text": "taped 3.200 m, found 3.210 m; D1 is 2.21 m"},
            {"words": "Correct L1 to 3.05 m", "changes": [{"length_m": 10 * FOOT_M}]},
            {"words": "Free it, 3.05 m up", "changes": [{"t": "height"}]},
        ],
    }
    exact = collect_lengths(message, state)

    for units, text, words in (
        (
            Units(length="ft", speed="mph"),
            "taped 10.500 ft, found 10.530 ft; D1 is 7.25 ft",
            "10.00 ft",
        ),
        (IMPERIAL, "taped 10 ft 6 in, found 10 ft 6 3/8 in; D1 is 7 ft 3 in", "10 ft 0 in"),
    ):
        first, button, other = convert_units(message, units, (), exact)["why"]
        assert first["text"] == text
        assert button["words"] == f"Correct L1 to {words}"
        assert other["words"].startswith("Free it, 10")
    assert collect_lengths({"t": "saved"}, state) == (0.01, 10.5 * FOOT_M)


def test_in_metres_only_speeds_are_told_anew() -> None:
    told = convert_units(MESSAGE, METRIC, ())

    assert told["messages"][0]["text"] == "at 50.0 km/h"
    assert {**told, "messages": MESSAGE["messages"]} == MESSAGE


def test_names_of_an_empty_project_need_no_care() -> None:
    assert list_kept_names(State()) == ()
