"""Session of picking: the state, its undo history, and the effect of each command. Pure.

Every step keeps the states before and after it. They share all unchanged parts, so storing them
costs little, and undo is exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from uavgram.io.tables.measure import points_fault
from uavgram.model.observations import MeasurementRequest
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.document.labels import forget, merge, rename, split, swap
from uavgram.picking.document.state import Line, Pick, State, remove_matches

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
