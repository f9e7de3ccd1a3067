"""Corrections by name, from those by index (`SurveyCorrection`) and for single observations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import isclose

from uavgram.estimation.reliability.stated_values import UNITS
from uavgram.estimation.survey.names import ObservationNames
from uavgram.estimation.survey.observations.observation import Suspicion
from uavgram.model.message import (
    Correction,
    Message,
    MessagePlural,
    Remedy,
    propose_free_heights,
    propose_length_removal,
    propose_photo_removal,
    propose_pick_removal,
    propose_swap,
    propose_taking_back,
)
from uavgram.model.naming import join_names, join_photo_names
from uavgram.model.observations import Picks
from uavgram.model.survey import Survey, SurveyCorrection


def add_remedies(
    message: Message, survey: Survey, mends: Sequence[SurveyCorrection | None]
) -> Message:
    """Add possible corrections to a message.

    Parameters
    ----------
    message
        Message on a cause.
    survey
        All observations as stated.
    mends
        Corrections of the cause, and of its alternatives; None where only a person can correct it.
    """
    found = read_first([None if one is None else make_remedy(survey, one) for one in mends])
    rivals = [one for one in found[1:] if one is not None]
    # Where the photo itself was mirrored or turned, its picks are where they belong in it.
    turned = {pick for one in mends if one is not None for pick in one.pixel_of_pick}
    frames = dict.fromkeys(_pick(survey, pick)[0] for pick in sorted(turned))
    rivals += [propose_photo_removal(frame) for frame in frames]
    return replace(message, mend=found[0] if found else None, instead=tuple(rivals))


def read_first(remedies: Iterable[Remedy | None]) -> list[Remedy | None]:
    """Insert before each removal of a length the advice to read it again; None before a photo's.

    A photo is to be looked at before it is left out, and the message's text names for what.
    """
    found: list[Remedy | None] = []
    for one in remedies:
        if one is not None and one.action == "remove-length":
            names = [change.length for change in one.corrections]
            found.append(
                Remedy(
                    action="read",
                    words=f"Read {join_names(names)} again",
                    corrections=tuple(Correction(action="read", length=name) for name in names),
                )
            )
        elif one is not None and one.action == "leave-out":
            found.append(None)
        found.append(one)
    return found


def keep_first_clicks(messages: Iterable[Message], picks: Picks) -> tuple[Message, ...]:
    """Take back the second click where a message proposes to remove a pick that was clicked twice.

    Parameters
    ----------
    messages
        Messages on a survey.
    picks
        Its picks.
    """
    counts = Counter(zip(picks.image, picks.label, strict=True))
    repeated = {pair for pair, count in counts.items() if count > 1}
    if not repeated:
        return tuple(messages)
    return tuple(
        replace(
            message,
            mend=_keep_first_click(message.mend, repeated) if message.mend else None,
            instead=tuple(_keep_first_click(one, repeated) for one in message.instead),
        )
        for message in messages
    )


def _keep_first_click(remedy: Remedy, repeated: Container[tuple[str, str]]) -> Remedy:
    again = [
        one.action == "unpick" and (one.frame, one.label) in repeated for one in remedy.corrections
    ]
    if again and all(again):
        return propose_taking_back([(one.frame, one.label) for one in remedy.corrections])
    changes = tuple(
        replace(one, action="take-back") if is_again else one
        for one, is_again in zip(remedy.corrections, again, strict=True)
    )
    return replace(remedy, corrections=changes)


def report_not_located(names: ObservationNames, suspicion: Suspicion, detail: str) -> Message:
    """Report that one of several observations is wrong, and that no test shows which.

    Parameters
    ----------
    names, suspicion
        Names of the observations, and those of which one is wrong.
    detail
        Sentences on the size of the misfit, and on the consequence.
    """
    members = (suspicion.suspect, *suspicion.group, *suspicion.rivals)
    causes = names.causes(members)
    text = (
        f"One of these does not fit, and no test shows which: the {causes}. Look at all of them; "
        f"click on the points again, or tape another line. {detail}"
    )
    several = MessagePlural(
        "{count} times one of several observations does not fit, and no test shows which",
        f"the {causes}",
        ending="Look at all of them; click on the points again, or tape another line.",
    )
    either = read_first(names.find_kind(member).remedy(member.row) for member in members)
    return Message(
        "warning",
        "blunder-not-located",
        text,
        **names.subjects(*members),
        several=several,
        instead=tuple(one for one in either if one is not None),
    )


def make_remedy(survey: Survey, mend: SurveyCorrection) -> Remedy | None:
    """Describe a correction by name; None where it changes no stated value.

    Parameters
    ----------
    survey
        All observations as stated.
    mend
        Correction, by index into it.
    """
    parts = (
        _labels(survey, mend),
        _places(survey, mend),
        _picks(survey, sorted(mend.without_picks | mend.apart)),
        _lengths(survey, mend),
        _ends(survey, mend),
        propose_length_removal([_line(survey, k) for k in sorted(mend.without_lines)]),
        _heights(survey, mend),
    )
    known = [one for one in parts if one is not None]
    if not known:
        return None
    # Remove picks before others take their labels.
    order = sorted(known, key=lambda one: one.action != "unpick")
    every = (change for one in order for change in one.corrections)
    words = [known[0].words, *(one.words[0].lower() + one.words[1:] for one in known[1:])]
    return replace(known[0], words=" and ".join(words), corrections=tuple(every))


def make_tape_remedy(start: str, end: str, length_m: float) -> Remedy:
    """Return a length to be taped as a check.

    Parameters
    ----------
    start, end
        Its labels.
    length_m
        Its approximate length.
    """
    ends = Correction(action="tape", ends=(start, end), length_m=length_m)
    words = f"Tape from {start} to {end}, about {length_m:.1f} m"
    return Remedy(action="tape", words=words, corrections=(ends,))


def _labels(survey: Survey, mend: SurveyCorrection) -> Remedy | None:
    if not mend.label_of_pick:
        return None
    everywhere = _everywhere(survey, mend.label_of_pick)
    if everywhere is not None:
        return propose_swap(*everywhere)
    by_frame: dict[str, dict[str, str]] = {}
    for pick, right in mend.label_of_pick.items():
        frame, label = _pick(survey, pick)
        by_frame.setdefault(frame, {})[label] = survey.label[right]
    changed = {f: {a: b for a, b in right.items() if a != b} for f, right in by_frame.items()}
    swaps = [one for frame, right in changed.items() for one in _swaps(frame, right)]
    if not swaps:
        return None
    where = join_photo_names(dict.fromkeys(one.frame for one in swaps))
    words = f"Change {sum(map(len, changed.values()))} labels in {where}"
    if len(swaps) == 1:
        first, second = swaps[0].label, swaps[0].other
        both = (swaps[0].frame, second) in {_pick(survey, k) for k in range(len(survey.pick_label))}
        words = f"Swap {first} and {second}" if both else f"Change {first} to {second}"
        words += f" in {where}"
    return Remedy(action="swap", words=words, corrections=tuple(swaps))


def _everywhere(survey: Survey, label_of_pick: Mapping[int, int]) -> tuple[str, str] | None:
    """Return two labels that are exchanged at all of their picks; otherwise None."""
    pairs = {(int(survey.pick_label[pick]), right) for pick, right in label_of_pick.items()}
    if len(pairs) != 2 or {(b, a) for a, b in pairs} != pairs:
        return None
    (first, second), _ = sorted(pairs)
    picks = {k for k, label in enumerate(survey.pick_label) if label in (first, second)}
    frames = {int(survey.pick_frame[k]) for k in picks}
    if picks != set(label_of_pick) or len(frames) < 2:
        return None
    return survey.label[first], survey.label[second]


def _swaps(frame: str, right: Mapping[str, str]) -> Iterator[Correction]:
    """Yield exchanges, one after another, after which each pick of a photo has its label.

    Parameters
    ----------
    frame
        The photo.
    right
        Label of a pick -> its correct label.
    """
    now = dict(right)  # present label of a pick -> its correct label
    for label in right:
        while label in now and now[label] != label:
            there = now[label]
            yield Correction(action="swap", frame=frame, label=label, other=there)
            mine, other = now.pop(label), now.pop(there, None)
            now[there] = mine
            if other is not None:
                now[label] = other


def _places(survey: Survey, mend: SurveyCorrection) -> Remedy | None:
    if not mend.pixel_of_pick:
        return None
    moves = []
    for pick, place in mend.pixel_of_pick.items():
        frame, label = _pick(survey, pick)
        moves.append(Correction(action="move", frame=frame, label=label, pixel_px=place))
    where = join_photo_names(dict.fromkeys(one.frame for one in moves))
    words = f"Put the picks of {where} back"
    return Remedy(action="move", words=words, corrections=tuple(moves))


def _picks(survey: Survey, picks: Iterable[int]) -> Remedy | None:
    return propose_pick_removal([_pick(survey, pick) for pick in picks])


def _lengths(survey: Survey, mend: SurveyCorrection) -> Remedy | None:
    named = {_line(survey, k): value for k, value in mend.length_m.items()}
    if not named or not all(named):
        return None
    changes = [Correction(action="length", length=n, length_m=value) for n, value in named.items()]
    unit = _unit(survey, mend.length_m)
    words = f"Correct these {len(named)} lengths"
    if unit:
        words = f"Take these {len(named)} lengths as {unit}"
    if len(named) == 1:
        what = f"Take {changes[0].length} as {unit}:" if unit else f"Correct {changes[0].length} to"
        words = f"{what} {changes[0].length_m:.2f} m"
    elif len(named) == 2 and _is_exchange(survey, mend.length_m):
        words = f"Swap the readings of {join_names(named)}"
    return Remedy(action="length", words=words, corrections=tuple(changes))


def _unit(survey: Survey, length_m: Mapping[int, float]) -> str:
    """Return the unit of lengths that should be in metres; empty for another slip."""
    ratios = {float(survey.length_m[k]) / value for k, value in length_m.items()}
    alike = (words for size, words in UNITS if all(isclose(one, size) for one in ratios))
    return next(alike, "")


def _is_exchange(survey: Survey, length_m: Mapping[int, float]) -> bool:
    """Return whether lengths exchange their readings."""
    return sorted(length_m.values()) == sorted(float(survey.length_m[k]) for k in length_m)


def _ends(survey: Survey, mend: SurveyCorrection) -> Remedy | None:
    label = survey.label
    named = {_line(survey, k): (label[a], label[b]) for k, (a, b) in mend.ends.items()}
    if not named or not all(named):
        return None
    changes = [Correction(action="ends", length=name, ends=ends) for name, ends in named.items()]
    words = f"Correct the ends of {join_names(named)}"
    if len(named) == 1:
        words = f"Take {changes[0].length} from {changes[0].ends[0]} to {changes[0].ends[1]}"
    return Remedy(action="ends", words=words, corrections=tuple(changes))


def _heights(survey: Survey, mend: SurveyCorrection) -> Remedy | None:
    """Return heights to be freed, and free heights to be put back on the ground."""
    up = propose_free_heights([survey.label[k] for k, free in mend.free.items() if free])
    down = [survey.label[k] for k, free in mend.free.items() if not free and survey.is_free[k]]
    if not down:
        return up
    changes = tuple(Correction(action="on-ground", label=label) for label in down)
    ground = Remedy(
        action="on-ground", words=f"Put {join_names(down)} on the ground", corrections=changes
    )
    return ground if up is None else replace(up, corrections=(*up.corrections, *changes))


def _pick(survey: Survey, pick: int) -> tuple[str, str]:
    """Return photo and label of a pick, as stated."""
    return survey.frame_id[survey.pick_frame[pick]], survey.label[survey.pick_label[pick]]


def _line(survey: Survey, line: int) -> str:
    return survey.line_name[line] if survey.line_name else ""
