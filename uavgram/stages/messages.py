"""Order the messages of a run: one message for each kind, the likeliest cause first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

from uavgram.model.message import NUMBERS, SUBJECTS, Message, MessagePlural, Remedy
from uavgram.model.message import merge_remedies as mended_together
from uavgram.model.message_catalogue import entry_of
from uavgram.model.naming import format_digits
from uavgram.model.survey import Cause

TAKEN_INTO_ACCOUNT = "The results take it into account."
"""End of a message on wrong prior knowledge that was given up."""

MAX_LISTED = 5
"""Number of things that a sentence lists; the message names all of them as data."""

LEVELS = ("error", "warning", "info")


def downgrade_explained(messages: Iterable[Message], causes: Sequence[Cause]) -> Iterator[Message]:
    """Reduce messages to information where a cause explains the misfit that they report.

    Parameters
    ----------
    messages
        Messages from the stages.
    causes
        Causes of misfits.
    """
    settled = {name for cause in causes for name in cause.settles}
    settled |= {name for cause in causes for name in cause.message.lengths}
    picks = {
        (frame, label)
        for cause in causes
        for frame in cause.message.frames
        for label in cause.message.labels
    }
    own = {id(cause.message) for cause in causes}
    for message in messages:
        named = {*message.lengths} if message.lengths else {*message.frames}
        pairs = {(f, label) for f in message.frames for label in message.labels}
        innocent = (bool(named) and named <= settled) or (bool(pairs) and pairs <= picks)
        if entry_of(message.code).accuses and innocent and id(message) not in own:
            yield replace(message, level="info")
        else:
            yield message


def order_messages(*messages: Message) -> tuple[Message, ...]:
    """Sort messages for people, each once, and join those of one kind.

    Parameters
    ----------
    messages
        Messages from the stages.

    Returns
    -------
    Causes that were found before errors, these before warnings, and choices last; within one level
    causes first and their consequences last, otherwise in the order of the input. The function is
    idempotent.
    """
    groups: dict[object, list[Message]] = {}
    for message in dict.fromkeys(messages):
        groups.setdefault(_kind(message), []).append(message)
    joined = [_join_messages(group) for group in groups.values()]
    joined.sort(key=_place)
    return tuple(joined)


def _place(message: Message) -> tuple[int, int]:
    """Return the place in the order: a warning of a found cause precedes the errors it explains."""
    order = entry_of(message.code).order
    is_cause = message.level == "warning" and order.is_found_cause
    return 0 if is_cause else 1 + LEVELS.index(message.level), order


def _kind(message: Message) -> object:
    several = message.several
    if several is None:
        return message
    return message.level, message.code, several.opening, several.ending


def _join_messages(group: Sequence[Message]) -> Message:
    """Join several messages of a kind."""
    first, several = group[0], [m.several for m in group if m.several is not None]
    if len(group) == 1:
        return replace(first, several=None)
    together: dict[str, Any] = {
        what: tuple(dict.fromkeys(chain.from_iterable(getattr(m, what) for m in group)))
        for what in SUBJECTS
    }
    together["equals"] = tuple(dict.fromkeys(chain.from_iterable(m.equals for m in group)))
    for what in NUMBERS:
        together[what] = tuple(chain.from_iterable(getattr(m, what) for m in group))
    opening = several[0].opening.replace("{count}", str(len(group)))
    sentences = (f"{opening}: {_join_with_reasons(several)}.", several[0].ending)
    text = " ".join(filter(None, sentences))
    mend, *instead = _combine_remedies([(m.mend, *m.instead) for m in group])
    rest = tuple(one for one in instead if one is not None)
    return replace(first, text=text, several=None, plain="", mend=mend, instead=rest, **together)


def _combine_remedies(remedies: Sequence[tuple[Remedy | None, ...]]) -> list[Remedy | None]:
    """Return a correction for several messages together, and its alternatives, likeliest first.

    Where one message has several possible corrections, there is no common one. To read a length
    again, or to remove it, are two ways of the same correction.
    """
    again = all(one[0] is not None and one[0].action == "read" for one in remedies)
    if max(map(len, remedies)) > (2 if again else 1):
        return [None]
    return [mended_together(each) for each in zip(*remedies, strict=True)]


def _join_with_reasons(several: Sequence[MessagePlural]) -> str:
    """Return ``'a', 'b' (too few picks); 'c' (in the sky); and 4 more``."""
    by_reason: dict[str, list[str]] = {}
    for one in several[:MAX_LISTED]:
        items = by_reason.setdefault(one.why, [])
        if one.item not in items:  # as where one label was picked twice in a photo
            items.append(one.item)
    separator = "; " if any(", " in one.item for one in several) else ", "
    parts = [
        separator.join(items) + (f" ({why})" if why else "") for why, items in by_reason.items()
    ]
    if (more := len(several) - MAX_LISTED) > 0:
        parts.append(f"and {more} more")
    return "; ".join(parts)


def report_clock_off(off_s: float, sigma_s: float) -> Message:
    """Report by how much the camera's clock is off."""
    way = "fast" if off_s > 0 else "slow"
    return Message(
        "warning",
        "clock-off",
        f"The camera's clock is {abs(off_s):.1f} ± {format_digits(sigma_s, 1)} s off, more than "
        "the stated sigma allows: change `time.offset_s` in the project by "
        f"{off_s:+.1f} (the clock is {way}).",
    )
