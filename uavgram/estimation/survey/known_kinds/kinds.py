"""Registry of the kinds of known things.

To add a kind, write it in a file of this folder and name it here.
"""

from __future__ import annotations

from uavgram.estimation.survey.known_kinds.azimuth import AZIMUTH
from uavgram.estimation.survey.known_kinds.conditions import CONDITIONS
from uavgram.estimation.survey.known_kinds.known_kind import KnownKind
from uavgram.estimation.survey.known_kinds.measured import MEASURED
from uavgram.estimation.survey.known_kinds.on_line import LINE_OF_POSITION
from uavgram.model.observations import ON_LINE, KnownThings

ALL_KINDS: dict[str, KnownKind] = {
    one.name: one for one in (*MEASURED, *CONDITIONS, AZIMUTH, LINE_OF_POSITION)
}
"""All kinds by name."""

KNOWN_KINDS = {name: one for name, one in ALL_KINDS.items() if name != ON_LINE}
"""Kinds of the table of known things; lines of known position have a table of their own."""


def determine_scale(known: KnownThings) -> bool:
    """Return whether any known thing that is an observation determines the scale."""
    rows = zip(known.kind, known.value.tolist(), known.adjust.tolist(), strict=True)
    return any(ALL_KINDS[kind].gives_scale(value) for kind, value, adjust in rows if adjust)
