"""Messages of the page as commands and questions; all input is checked here.

A message is a JSON object ``{"seq": n, "t": kind, ...}``, with ``"step"`` where several changes
are one step for the user (a drag, a run of nudges). Photos are numbers, never names or paths.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn, TypeVar, get_args

from uavgram.io.tables.measure import (
    parameter_fault,
)
from uavgram.model.camera import LensModel
from uavgram.model.limits import (
    LONGEST_NAME,
    find_choice_fault,
    find_name_fault,
    find_unshowable,
    find_value_fault,
)
from uavgram.model.naming import format_digits
from uavgram.model.observations import MEASUREMENT_FORMS, Along, MeasurementKind, Source
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError

MAX_MESSAGE_BYTES = 1_000_000
MAX_POINTS = 256
MAX_PAIRS = 10_000
MAX_CHANGES = 10_000
MAX_INTEGER = 2**53

_UNIT = re.compile(r"_(px|m)$")  # of a field; shown to people without it

_TARGETS: tuple[c.Target, ...] = ("any", "target")

Choice = TypeVar("Choice", bound=str)

Body = c.Command | c.Accept | c.Question | c.ProjectAction


@dataclass(frozen=True)
class PhotoSize:
    """Photo that messages may name by its number: file name and stored size [px]."""

    name: str
    width_px: int
    height_px: int


@dataclass(frozen=True, kw_only=True)
class Message:
    """Checked message.

    Attributes
    ----------
    seq
        Sequence number given by the page; the answer carries it.
    step
        Changes with the same step (not 0) are undone together.
    final
        Whether the step ends here: until then an approximate answer suffices.
    body
        The command or question.
    """

    seq: int
    step: int
    final: bool
    body: Body


def parse_message(text: str | bytes, photos: Sequence[PhotoSize]) -> Message:
    """Check a message and convert it into a command or question.

    Raises
    ------
    RefusedError
        The message is not valid; the text gives the reason.
    """
    if len(text) > MAX_MESSAGE_BYTES:
        _refuse(f"a message may have {MAX_MESSAGE_BYTES} bytes")
    try:
        data = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError):
        _refuse("the message is not JSON")
    if not isinstance(data, dict):
        _refuse("the message is not an object")
    fields = _Fields(data, photos)
    seq = fields.integer("seq")
    try:
        return _parse(fields, seq)
    except RefusedError as why:
        why.seq = seq  # the page waits for the answer to this number
        raise


def _parse(fields: _Fields, seq: int) -> Message:
    kind = fields.text("t")
    if kind not in KINDS:
        _refuse(f"there is no command {kind!r}")
    step = fields.integer("step", default=0)
    final = fields.flag("final", default=True)
    command = KINDS[kind]
    return Message(seq=seq, step=step, final=final, body=_read(command, fields))


def _read(command: type[Body], fields: _Fields) -> Body:
    """Build a command from the fields of a message; raises `RefusedError` if any is left over."""
    readers = _READERS | _OWN_READERS.get(command, {})
    given: dict[str, Any] = {
        one.name: readers[one.name](fields) for one in dataclasses.fields(command)
    }
    fields.nothing_else()
    return command(**given)


def _refuse(why: str) -> NoReturn:
    raise RefusedError(why)


def _no_number(text: str) -> NoReturn:
    _refuse(f"{text} is no number")


class _Fields:
    """Reader of the fields of a message, one by one; null is the same as no field.

    Attributes
    ----------
    size, kind
        Size of the photo and kind of the measurement named last; later fields depend on them.
    """

    size: PhotoSize
    kind: MeasurementKind

    def __init__(self, data: dict[str, Any], photos: Sequence[PhotoSize]) -> None:
        self._data = {name: value for name, value in data.items() if value is not None}
        self._photos = photos

    def _take(self, name: str) -> Any:  # noqa: ANN401  (JSON: anything)
        if name not in self._data:
            _refuse(f"{_UNIT.sub('', name)} is missing")
        return self._data.pop(name)

    def nothing_else(self) -> None:
        if self._data:
            _refuse(f"unknown field {next(iter(self._data))[:LONGEST_NAME]!r}")

    def text(self, name: str, *, empty: bool = False) -> str:
        value = self._take(name)
        if not isinstance(value, str):
            _refuse(f"{name} must be text")
        value = value.strip()
        if not value and not empty:
            _refuse(f"{name} is empty")
        if fault := find_name_fault(value):
            _refuse(f"{name} {fault}")
        if fault := find_unshowable(value):
            _refuse(f"{name} holds {fault}: type it again")
        return value

    def optional_text(self, name: str) -> str | None:
        return self.text(name, empty=True) if self.has(name) else None

    def has(self, name: str) -> bool:
        return name in self._data

    def label(self, name: str = "label") -> str:
        value = self.text(name)
        if ";" in value:
            _refuse("a label cannot hold a semicolon, which separates a measurement's labels")
        return value

    def choice(self, name: str, known: Sequence[Choice]) -> Choice:
        value = self.text(name)
        for one in known:
            if one == value:
                return one
        _refuse(f"{name} {find_choice_fault(value, known)}")

    def flag(self, name: str, *, default: bool | None = None) -> bool:
        value = default if default is not None and name not in self._data else self._take(name)
        if not isinstance(value, bool):
            _refuse(f"{name} must be true or false")
        return value

    def integer(self, name: str, *, default: int | None = None) -> int:
        value = default if default is not None and name not in self._data else self._take(name)
        if not isinstance(value, int) or isinstance(value, bool):
            _refuse(f"{name} must be a whole number")
        if not 0 <= value < MAX_INTEGER:
            _refuse(f"{name} is out of range")
        return value

    def number(self, name: str, fault_of: Callable[[float], str] | None = None) -> float:
        """Take a number that a field of this name may have in a table, or by a rule of its own."""
        value = self._take(name)
        if not isinstance(value, int | float) or isinstance(value, bool):
            _refuse(f"{_UNIT.sub('', name)} must be a number")
        fault = find_value_fault(
            "" if fault_of else name, value
        )  # a whole number may have any size
        if fault := fault or (fault_of(value) if fault_of else ""):
            _refuse(f"{_UNIT.sub('', name)} {fault}")
        return float(value)

    def between(self, name: str, least: float, most: float) -> float:
        value = self.number(name)
        if not least <= value <= most:
            _refuse(
                f"{_UNIT.sub('', name)} must lie between {format_digits(least, 6)} and "
                f"{format_digits(most, 6)}"
            )
        return value

    def optional(self, name: str, fault_of: Callable[[float], str] | None = None) -> float | None:
        return self.number(name, fault_of) if self.has(name) else None

    def photo(self, name: str = "image") -> PhotoSize:
        index = self.integer(name)
        if index >= len(self._photos):
            _refuse(f"there is no photo {index}")
        self.size = self._photos[index]
        return self.size

    def other_photo(self, name: str) -> str:
        """Take the name of an optional photo, else empty; later pixels refer to that photo."""
        return self.photo(name).name if self.has(name) else ""

    def place(self, name: str, size: float) -> float:
        """Take a pixel coordinate in a photo of a given size."""
        return self.between(name, -0.5, size - 0.5)

    def optional_place(self, name: str, size: float) -> float | None:
        return self.place(name, size) if self.has(name) else None

    def measurement_kind(self) -> MeasurementKind:
        self.kind = self.choice("kind", tuple(MEASUREMENT_FORMS))
        return self.kind

    def pairs(self, name: str) -> tuple[tuple[str, str], ...]:
        """Take pairs of photo, by number, and label."""
        values = self._take(name)
        if not isinstance(values, list) or not 0 < len(values) <= MAX_PAIRS:
            _refuse(f"{name} must be a list of 1 to {MAX_PAIRS} pairs of photo and label")
        found = []
        for value in values:
            if not isinstance(value, list) or len(value) != 2:
                _refuse(f"{name} must hold pairs of photo and label")
            one = _Fields({"image": value[0], "label": value[1]}, self._photos)
            found.append((one.photo().name, one.label()))
        return tuple(found)

    def photos(self, name: str) -> tuple[str, ...]:
        """Take photos by number and return their names."""
        values = self._take(name)
        if not isinstance(values, list) or not 0 < len(values) <= len(self._photos):
            _refuse(f"{name} must be a list of 1 to {len(self._photos)} photos")
        return tuple(_Fields({"image": value}, self._photos).photo().name for value in values)

    def changes(self, name: str) -> tuple[c.SingleChange, ...]:
        """Take changes, each like a message without sequence number."""
        values = self._take(name)
        if not isinstance(values, list) or not 0 < len(values) <= MAX_CHANGES:
            _refuse(f"{name} must be a list of 1 to {MAX_CHANGES} changes")
        found = []
        for value in values:
            if not isinstance(value, dict):
                _refuse(f"{name} must hold objects")
            inner = _Fields(value, self._photos)
            kind = inner.text("t")
            change = _read(KINDS[kind], inner) if kind in KINDS else None
            if not isinstance(change, c.SingleChange):
                _refuse(f"{kind!r} is no change that can be made together with others")
            found.append(change)
        return tuple(found)

    def names(self, name: str) -> tuple[str, ...]:
        values = self._take(name)
        if not isinstance(values, list) or not 0 < len(values) <= MAX_PAIRS:
            _refuse(f"{name} must be a list of 1 to {MAX_PAIRS} names")
        return tuple(_Fields({name: value}, ()).text(name) for value in values)

    def labels(self, name: str) -> tuple[str, ...]:
        values = self._take(name)
        if not isinstance(values, list) or len(values) > MAX_POINTS:
            _refuse(f"{name} must be a list of at most {MAX_POINTS} labels")
        return tuple(_Fields({name: value}, ()).label(name) for value in values)

    def parameters(self) -> tuple[tuple[str, float], ...]:
        form = MEASUREMENT_FORMS[self.kind]
        values = self._data.pop("parameters", {})
        if not isinstance(values, dict):
            _refuse("parameters must be an object")
        inner = _Fields(values, ())
        wanted = form.parameters + tuple(filter(inner.has, form.optional))
        found = tuple((name, inner.number(name, partial(parameter_fault, name))) for name in wanted)
        inner.nothing_else()
        return found


def _score_fault(value: float) -> str:
    return "" if 0.0 <= value <= 1.0 else "must lie between 0 and 1"


_MODELS: tuple[LensModel, ...] = ("brown", "fisheye")

# A field of a message has the name of the command's field, with one meaning in all commands.
_READERS: dict[str, Callable[[_Fields], object]] = {
    "image": lambda f: f.photo().name,
    "u_px": lambda f: f.place("u_px", f.size.width_px),
    "v_px": lambda f: f.place("v_px", f.size.height_px),
    "source": lambda f: f.choice("source", get_args(Source)) if f.has("source") else "hand",
    "score": lambda f: f.optional("score", _score_fault),
    "from_image": lambda f: f.other_photo("from_image"),
    "from_u_px": lambda f: f.optional_place("from_u_px", f.size.width_px),
    "from_v_px": lambda f: f.optional_place("from_v_px", f.size.height_px),
    "label": _Fields.label,
    "new": lambda f: f.label("new"),
    "into": lambda f: f.label("into"),
    "keep": lambda f: f.label("keep") if f.has("keep") else "",
    "images": lambda f: f.photos("images"),
    "other": lambda f: f.label("other"),
    "changes": lambda f: f.changes("changes"),
    "start": lambda f: f.label("start"),
    "end": lambda f: f.label("end"),
    "was": lambda f: f.text("was", empty=True),
    "name": lambda f: f.text("name"),
    "names": lambda f: f.names("names"),
    "sigma_px": lambda f: f.optional("sigma_px"),
    "height_m": lambda f: f.optional("height_m"),
    "height_sigma_m": lambda f: f.optional("height_sigma_m"),
    "is_taken_back": lambda f: f.flag("is_taken_back", default=False),
    "is_repetition": lambda f: f.flag("is_repetition", default=False),
    "is_free": lambda f: f.flag("is_free", default=False),
    "length_m": lambda f: f.number("length_m"),
    "sigma_m": lambda f: f.number("sigma_m"),
    "adjust": lambda f: f.flag("adjust", default=True),
    "tape": lambda f: f.optional_text("tape"),
    "along": lambda f: f.choice("along", get_args(Along)) if f.has("along") else None,
    "kind": _Fields.measurement_kind,
    "points": lambda f: f.labels("points"),
    "pairs": lambda f: f.pairs("pairs"),
    "parameters": _Fields.parameters,
    "target": lambda f: f.choice("target", _TARGETS),
    "expected": lambda f: f.label("expected") if f.has("expected") else "",
    "folder": lambda f: f.integer("folder"),
    "board": lambda f: f.text("board"),
    "model": lambda f: f.choice("model", _MODELS),
    "work": lambda f: f.choice("work", get_args(c.Work)),
}

# Fields that have another meaning in one command.
_OWN_READERS: dict[type[Body], dict[str, Callable[[_Fields], object]]] = {
    c.Swap: {"image": lambda f: f.other_photo("image")},
}

KINDS: dict[str, type[Body]] = {
    "place": c.Place,
    "repeat": c.Repeat,
    "accept": c.Accept,
    "refuse": c.Refuse,
    "unpick": c.Unpick,
    "forget": c.Forget,
    "rename": c.Rename,
    "merge": c.Merge,
    "split": c.Split,
    "swap": c.Swap,
    "all": c.All,
    "sigma": c.SetSigma,
    "height": c.SetHeight,
    "line": c.SetLine,
    "remove-line": c.RemoveLine,
    "measure": c.SetMeasurement,
    "remove-measurement": c.RemoveMeasurement,
    "undo": c.Undo,
    "redo": c.Redo,
    "export": c.Export,
    "reload": c.Reload,
    "leave-out": c.LeaveOut,
    "use-recorded": c.UseRecorded,
    "take-aside": c.TakeAside,
    "discard-aside": c.DiscardAside,
    "folders": c.Folders,
    "calibrate": c.Calibrate,
    "stop-work": c.StopWork,
    "use-camera": c.UseCamera,
    "snap": c.Snap,
    "ground": c.SameGround,
    "side": c.SideView,
    "ties": c.Ties,
}
