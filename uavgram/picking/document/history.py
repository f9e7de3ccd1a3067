"""Session of picking: state, undo history, effect of each command and of new labels. Pure.

Every step keeps the states before and after it. They share all unchanged parts, so storing them
costs little, and undo is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from uavgram.io.tables.measure import points_fault
from uavgram.model.naming import join_names
from uavgram.model.observations import MeasurementRequest
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.document.state import Line, Pick, State, remove_matches

Stated = dict[str, Any]
"""Statements in the picks of a label about its point, by field: a height, an area."""

_HEIGHT = ("height_m", "height_sigma_m", "is_free")
_MAX_NAMED = 3


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
    """Turn a match into a person's pick, without its source and the sigma of the matching."""
    if pick.source != "match":
        return pick
    return Pick(
        **{name: getattr(pick, name) for name in ("image", "label", "u_px", "v_px", "area")},
        **pick.height,
    )


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


def merge(state: State, do: c.Merge) -> State:
    """Merge two labels into one point.

    Raises
    ------
    RefusedError
        They cannot be one point, or `keep` does not name the picks that stay.
    """
    for label in (do.label, do.into):
        if label not in list_labels(state):
            raise RefusedError(f"there is no label {label!r}")
    if do.label == do.into:
        raise RefusedError(f"{do.label!r} is that point already: choose another one")
    stated = _combine_statements(state, do.label, do.into)
    alone = _keep_one_pick_each(state, do)
    after = rename_in_state(alone, do.label, do.into)
    _refuse_zero_lengths(alone, after, do)
    picks = tuple(
        replace(pick, **stated) if pick.label == do.into else pick for pick in after.picks
    )
    return replace(after, picks=picks)


def split(state: State, do: c.Split) -> State:
    """Split off some picks of a label as another point.

    Matches found from one of these picks show the same point and move along with it. A match that
    moves away from the pick it was found from becomes a person's pick: the person who identifies it
    has picked it. Lengths and measurements stay with the label.

    Raises
    ------
    RefusedError
        The name is taken, or one of the two points would have no pick.
    """
    if do.new in list_labels(state):
        raise RefusedError(f"there is a label {do.new!r} already: choose another name")
    own = [pick for pick in state.picks if pick.label == do.label]
    going = _add_matches(own, [pick for pick in own if pick.image in do.images])
    if not going:
        raise RefusedError(f"{do.label!r} is not picked in these photos")
    if len(going) == len(own):
        raise RefusedError(
            f"no pick of {do.label!r} would be left: rename it, or choose fewer photos"
        )
    # the statements about the point apply to both new points
    stated = _collect_statements(own)
    picks = []
    for pick in state.picks:
        if pick.label != do.label:
            picks.append(pick)
        elif pick in going:
            has_source = any(pick.is_match_of(one) for one in going)
            moved = pick if has_source else _make_manual(pick)
            picks.append(replace(moved, label=do.new, **stated))
        else:
            picks.append(replace(pick, **stated))
    return replace(state, picks=tuple(picks))


def _keep_one_pick_each(state: State, do: c.Merge) -> State:
    """Keep one pick of the two labels in each photo; remove matches found from the others."""
    keys = {pick.key for pick in state.picks}
    both = {image for image, label in keys if label == do.label and (image, do.into) in keys}
    if both and do.keep not in {do.label, do.into}:
        raise RefusedError(
            f"{do.label!r} and {do.into!r} are both picked in "
            f"{join_names(sorted(both), _MAX_NAMED)}: "
            "say whose picks stay there, or remove one of them"
        )
    going = do.label if do.keep == do.into else do.into
    lost = [pick for pick in state.picks if pick.label == going and pick.image in both]
    for pick in lost:
        state = remove_matches(state, pick)
    return replace(state, picks=tuple(pick for pick in state.picks if pick not in lost))


def _refuse_zero_lengths(before: State, after: State, do: c.Merge) -> None:
    lost = [line.name for line in after.lines if line.start == line.end]
    asked = zip(before.requests, after.requests, strict=True)
    lost += [new.name for old, new in asked if points_fault(new) and not points_fault(old)]
    if lost:
        raise RefusedError(
            f"{do.label!r} and {do.into!r} stand as two points in {join_names(lost, _MAX_NAMED)}: "
            f"as "
            "one they leave nothing to measure there. Remove that first, if they are one point"
        )


def _combine_statements(state: State, one: str, other: str) -> Stated:
    """Return the statements about two labels that become one point; statements replace gaps."""
    sides = [
        _collect_statements([pick for pick in state.picks if pick.label == label])
        for label in (one, other)
    ]
    for group, words in ((_HEIGHT, "height"), (("area",), "area")):
        said = [{name: side[name] for name in group if name in side} for side in sides]
        if all(said) and said[0] != said[1]:
            raise RefusedError(
                f"{one!r} and {other!r} have not the same {words}: state the same of both first, "
                "if they are one point"
            )
    return sides[0] | sides[1]


def _collect_statements(picks: list[Pick]) -> Stated:
    """Return the statements about a label's point; a statement of one pick holds for all."""
    heights: Stated = {
        "height_m": _first(pick.height_m for pick in picks),
        "height_sigma_m": _first(pick.height_sigma_m for pick in picks),
        "is_free": any(pick.is_free for pick in picks),
    }
    area = _first(pick.area or None for pick in picks)
    is_stated = heights["is_free"] or heights["height_m"] is not None
    return (heights if is_stated else {}) | ({} if area is None else {"area": area})


def _first(values: Iterable[Any]) -> Any:  # noqa: ANN401  (values of any type)
    return next((value for value in values if value is not None), None)


def _add_matches(own: list[Pick], going: list[Pick]) -> list[Pick]:
    """Return picks with the matches found from them, and the matches found from those."""
    more = [pick for pick in own if pick not in going and any(map(pick.is_match_of, going))]
    return _add_matches(own, [*going, *more]) if more else going


MAX_STEPS = 10_000
"""Greatest number of steps that can be undone; older ones are dropped."""

MAX_ITEMS = 20_000
"""Largest number of picks, lengths or measurements of a project.

Far more than any survey needs, and still fast to process.
"""

Named = TypeVar("Named", Line, MeasurementRequest)


@dataclass(frozen=True, kw_only=True)
class Session:
    """Picked state with its undo and redo history.

    Attributes
    ----------
    state
        Present state.
    past, future
        States to undo to, the latest last; states to redo to, the next last.
    step
        Number of the step that further changes may join (a drag); 0: none.
    """

    state: State
    past: tuple[State, ...] = ()
    future: tuple[State, ...] = ()
    step: int = 0


def apply(session: Session, command: c.Command, step: int = 0) -> Session:
    """Apply a command to a session and return the new session.

    Parameters
    ----------
    session
        Session before the command.
    command
        Command to apply. A change without effect returns the session unchanged.
    step
        Consecutive changes with the same number (not 0) form one step.

    Raises
    ------
    RefusedError
        The command does not fit the state; the message gives the reason.
    """
    match command:
        case c.Undo():
            return _undo(session)
        case c.Redo():
            return _redo(session)
    after = apply_change(session.state, command)
    if after == session.state:
        return session
    if step and step == session.step:
        return replace(session, state=after, future=())
    past = (*session.past, session.state)[-MAX_STEPS:]
    return Session(state=after, past=past, step=step)


def _undo(session: Session) -> Session:
    if not session.past:
        raise RefusedError("there is nothing to undo")
    return Session(
        state=session.past[-1],
        past=session.past[:-1],
        future=(*session.future, session.state),
    )


def _redo(session: Session) -> Session:
    if not session.future:
        raise RefusedError("there is nothing to do again")
    return Session(
        state=session.future[-1],
        past=(*session.past, session.state),
        future=session.future[:-1],
    )


def apply_change(state: State, change: c.Change) -> State:
    """Return the state after a change; raises `RefusedError` if the change does not fit."""
    after = _CHANGES[type(change)](state, change)
    counts = {
        "picks": len(after.picks),
        "lengths": len(after.lines),
        "measurements": len(after.requests),
    }
    for what, count in counts.items():
        if count > MAX_ITEMS:
            raise RefusedError(f"a project may have {MAX_ITEMS} {what}")
    return after


def _place(state: State, do: c.Place) -> State:
    there = state.pick(do.image, do.label)
    if there is not None:
        return _update_pick(state, there, do)
    same = next((pick for pick in state.picks if pick.label == do.label), None)
    new = Pick(**vars(do))
    if same is not None:
        new = replace(new, **same.height, area=same.area)
    return replace(state, picks=(*state.picks, new))


def _place_all(state: State, do: c.PlaceAll) -> State:
    for place in do.places:
        if state.pick(place.image, place.label) is None:
            state = _place(state, place)
    return state


def _update_pick(state: State, there: Pick, do: c.Place) -> State:
    """Update an existing pick; a changed position makes it a pick of the one who placed it.

    Parameters
    ----------
    state, there
        State before, and the pick.
    do
        New position and origin.

    Raises
    ------
    RefusedError
        The program tried to change a pick that a person made.
    """
    if (do.u_px, do.v_px, do.source) == (there.u_px, there.v_px, "hand"):
        stays = there.sigma_px if do.sigma_px is None else do.sigma_px
        return _set_pick(state, there, replace(there, sigma_px=stays))
    if there.source == "hand" != do.source:
        raise RefusedError(f"a person picked {do.label!r} in {do.image!r} already")
    # A match has the sigma of the matching, not of a click by hand.
    own = there.sigma_px if there.source == do.source else None
    sigma = own if do.sigma_px is None else do.sigma_px
    # Keep a person's entries in columns that are also used for picks of the program.
    made = {} if there.source == do.source == "hand" else vars(do)
    new = replace(there, **made | {"u_px": do.u_px, "v_px": do.v_px, "sigma_px": sigma})
    return _set_pick(remove_matches(state, there), there, new)


def _repeat(state: State, do: c.Repeat) -> State:
    there = _require_pick(state, do.image, do.label)
    count = sum(pick.key == there.key for pick in state.picks)
    stated = {**there.height, "area": there.area, "again": count}
    return replace(state, picks=(*state.picks, Pick(**vars(do), **stated)))


def _unpick(state: State, do: c.Unpick) -> State:
    there = _require_pick(state, do.image, do.label)
    if do.is_repetition:
        own = [pick for pick in state.picks if pick.key == there.key]
        if len(own) == 1:
            raise RefusedError(f"{do.label!r} was clicked once in {do.image!r}")
        last = max(own, key=lambda pick: pick.again)
        return replace(state, picks=tuple(pick for pick in state.picks if pick is not last))
    kept = tuple(pick for pick in state.picks if pick.key != there.key)
    return remove_matches(replace(state, picks=kept), there)


def _set_sigma(state: State, do: c.SetSigma) -> State:
    there = _require_pick(state, do.image, do.label)
    return _set_pick(state, there, replace(there, sigma_px=do.sigma_px))


def _set_height(state: State, do: c.SetHeight) -> State:
    if do.label not in state.labels:
        raise RefusedError(f"{do.label!r} is not picked")
    if do.is_free and do.height_m is not None:
        raise RefusedError("a height is either stated or free: leave one of the two out")
    if do.height_sigma_m is not None and do.height_m is None:
        raise RefusedError("this is the sigma of no height: state the height too")
    stated = {name: value for name, value in vars(do).items() if name != "label"}
    picks = tuple(
        replace(pick, **stated) if pick.label == do.label else pick for pick in state.picks
    )
    return replace(state, picks=picks)


def _set_line(state: State, do: c.SetLine) -> State:
    if do.start == do.end:
        raise RefusedError("a length needs two different labels")
    there = next((one for one in state.lines if one.name == do.was), None)
    kept = {} if there is None else {"tape": there.tape, "along": there.along}
    stated = {name: value for name, value in _drop_was(do).items() if value is not None}
    line = Line(**kept | stated)
    return replace(state, lines=_set_named(state.lines, do.was, line, "length"))


def _remove_line(state: State, do: c.RemoveLine) -> State:
    return replace(state, lines=_remove_named(state.lines, do.name, "length"))


def _set_measurement(state: State, do: c.SetMeasurement) -> State:
    request = MeasurementRequest(**_drop_was(do))
    if fault := points_fault(request):
        raise RefusedError(fault)
    return replace(state, requests=_set_named(state.requests, do.was, request, "measurement"))


def _remove_measurement(state: State, do: c.RemoveMeasurement) -> State:
    return replace(state, requests=_remove_named(state.requests, do.name, "measurement"))


def _all(state: State, do: c.All) -> State:
    for change in do.changes:
        state = _CHANGES[type(change)](state, change)
    return state


_CHANGES: dict[type, Callable[..., State]] = {
    c.Place: _place,
    c.Repeat: _repeat,
    c.PlaceAll: _place_all,
    c.Unpick: _unpick,
    c.Forget: forget,
    c.Rename: rename,
    c.Merge: merge,
    c.Split: split,
    c.Swap: swap,
    c.SetSigma: _set_sigma,
    c.SetHeight: _set_height,
    c.SetLine: _set_line,
    c.RemoveLine: _remove_line,
    c.SetMeasurement: _set_measurement,
    c.RemoveMeasurement: _remove_measurement,
    c.All: _all,
}


def _drop_was(do: c.SetLine | c.SetMeasurement) -> dict[str, Any]:
    return {name: value for name, value in vars(do).items() if name != "was"}


def _require_pick(state: State, image: str, label: str) -> Pick:
    there = state.pick(image, label)
    if there is None:
        raise RefusedError(f"{label!r} is not picked in {image!r}")
    return there


def _set_pick(state: State, old: Pick, new: Pick) -> State:
    return replace(state, picks=tuple(new if pick is old else pick for pick in state.picks))


def _set_named(items: tuple[Named, ...], was: str, new: Named, what: str) -> tuple[Named, ...]:
    """Return the items with `new` in place of the one named `was`, or appended at the end."""
    names = [item.name for item in items]
    if was and was not in names:
        raise RefusedError(f"there is no {what} {was!r}")
    if new.name != was and new.name in names:
        raise RefusedError(f"there is a {what} {new.name!r} already")
    kept: list[Named] = [new if was and item.name == was else item for item in items]
    if not was:
        kept.append(new)
    return tuple(kept)


def _remove_named(items: tuple[Named, ...], name: str, what: str) -> tuple[Named, ...]:
    if name not in [item.name for item in items]:
        raise RefusedError(f"there is no {what} {name!r}")
    return tuple(item for item in items if item.name != name)
