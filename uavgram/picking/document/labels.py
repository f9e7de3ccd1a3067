"""Changes of labels in picks, lengths and measurements; pure."""

from __future__ import annotations

from dataclasses import replace

from uavgram.picking.document import commands as c
from uavgram.picking.document.errors import RefusedError
from uavgram.picking.document.state import Pick, State, remove_matches


def forget(state: State, do: c.Forget) -> State:
    """Remove a label with its picks, lengths and measurements."""
    return State(
        picks=tuple(pick for pick in state.picks if pick.label != do.label),
        lines=tuple(line for line in state.lines if do.label not in {line.start, line.end}),
        requests=tuple(one for one in state.requests if do.label not in one.points),
    )


def rename(state: State, do: c.Rename) -> State:
    """Rename a label; raises `RefusedError` if the new name is taken."""
    if do.new != do.label and do.new in list_labels(state):
        raise RefusedError(f"there is a label {do.new!r} already")
    if do.label not in list_labels(state):
        raise RefusedError(f"there is no label {do.label!r}")
    return rename_in_state(state, do.label, do.new)


def swap(state: State, do: c.Swap) -> State:
    """Exchange the picks of two labels; lengths and measurements stay unchanged.

    In a photo in which only one of them is picked, the pick gets the other label. Stated heights
    stay with the label, as lengths do: people stated them for the point of that name.

    Raises
    ------
    RefusedError
        Both labels are the same, one of them does not exist, or neither is picked there.
    """
    other = {do.label: do.other, do.other: do.label}
    if len(other) < 2:
        raise RefusedError(f"{do.label!r} cannot be exchanged with itself")
    for label in other:
        if label not in list_labels(state):
            raise RefusedError(f"there is no label {label!r}")
    taken = [pick for pick in state.picks if pick.label in other and do.image in {pick.image, ""}]
    if not taken:
        where = f"in {do.image!r}" if do.image else "in any photo"
        raise RefusedError(f"neither {do.label!r} nor {do.other!r} is picked {where}")
    stated = {pick.label: {**pick.height, "area": pick.area} for pick in reversed(state.picks)}
    swapped = {}
    for pick in taken:
        label = other[pick.label]
        changes = {**stated.get(label, stated[pick.label]), "label": label}
        swapped[pick] = replace(_make_manual(pick) if do.image else pick, **changes)
        if do.image:
            state = remove_matches(state, pick)
    picks = tuple(swapped.get(pick, pick) for pick in state.picks)
    return replace(state, picks=picks)


def _make_manual(pick: Pick) -> Pick:
    """Turn a relabelled match into a person's pick, no longer a match of its source pick."""
    if pick.source != "match":
        return pick
    return Pick(image=pick.image, label=pick.label, u_px=pick.u_px, v_px=pick.v_px)


def list_labels(state: State) -> set[str]:
    """Return the labels of picks, lengths and measurements: one name is one physical point."""
    labels = set(state.labels)
    labels.update(*((line.start, line.end) for line in state.lines))
    labels.update(*(request.points for request in state.requests))
    return labels


def rename_in_state(state: State, old: str, new: str) -> State:
    """Rename one label in picks, lengths and measurements.

    Parameters
    ----------
    state
        State before.
    old, new
        Label before and after.
    """

    def named(label: str) -> str:
        return new if label == old else label

    return State(
        picks=tuple(replace(pick, label=named(pick.label)) for pick in state.picks),
        lines=tuple(
            replace(line, start=named(line.start), end=named(line.end)) for line in state.lines
        ),
        requests=tuple(
            replace(request, points=tuple(map(named, request.points))) for request in state.requests
        ),
    )
