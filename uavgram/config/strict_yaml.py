"""Strict YAML: the core schema of YAML 1.2, with the line of every key and value.

PyYAML on its own reads ``1e-3`` as text, ``no`` as false, ``12:30`` as 750 and ``010`` as 8, and of
two equal keys keeps the last. Here numbers are those of YAML 1.2.2, section 10.3.2 (decimal ones; a
leading zero makes text), only true and false are booleans, and equal keys are mistakes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import yaml

from uavgram.errors import InputError
from uavgram.input_files import read_text
from uavgram.model.limits import find_unshowable, replace_decimal_comma

KeyPath = tuple[str | int, ...]
Plain = str | int | float | bool | None | list["Plain"] | dict[str, "Plain"]

MAX_DEPTH = 20  # composing is recursive; no file of this program nests deeper than 3
MAX_ITEMS = 100_000
"""Limit of the list items in a file, such as photo names: a minute of reading."""
_PREFIX = "tag:yaml.org,2002:"


@dataclass(frozen=True)
class Document:
    """A YAML file as plain data.

    Attributes
    ----------
    path
        The file.
    data
        Mappings, lists, text, whole numbers, finite floats, booleans and None.
    lines
        Line number (from 1) of each key and each list item, by its path from the root.
    faults
        Mistakes that leave the rest readable (equal keys), as pairs of line and message.
    """

    path: Path
    data: Plain
    lines: dict[KeyPath, int]
    faults: tuple[tuple[int, str], ...]

    def line_of(self, key_path: KeyPath) -> int:
        """Return the line of a key or item, or of the innermost enclosing one in the file."""
        while key_path and key_path not in self.lines:
            key_path = key_path[:-1]
        return self.lines.get(key_path, 1)


def read_yaml(path: Path, most_items: int = MAX_ITEMS) -> Document:
    """Read a YAML file written by a person.

    Parameters
    ----------
    path
        The file.
    most_items
        Limit of the items of all its lists together, including nested lists.

    Raises
    ------
    InputError
        The file cannot be read, is not UTF-8, is not YAML, is empty, is nested too deeply, has too
        many items, or uses unsupported features (several documents, aliases, tags).
    """
    text = read_text(path, "save it as UTF-8")
    try:
        root = _compose(path, text, most_items)
    except yaml.MarkedYAMLError as fault:
        is_unclosed = "end of stream" in str(fault.problem) or "<stream end>" in str(fault.problem)
        mark = fault.context_mark if is_unclosed else fault.problem_mark
        line = mark.line + 1 if mark else None
        raise InputError(path, _explain(fault), line) from fault
    except yaml.reader.ReaderError as fault:
        line = text.count("\n", 0, fault.position) + 1
        raise InputError(
            path, f"character {chr(fault.character)!r} is not allowed: delete it", line
        ) from fault
    if root is None:
        raise InputError(path, "the file is empty", 1)
    plain = _Builder(path)
    return Document(path, plain.build(root, ()), plain.lines, tuple(plain.faults))


def _compose(path: Path, text: str, most_items: int) -> yaml.Node | None:
    loader = _Loader(path, text, most_items)
    try:
        return loader.get_single_node()
    finally:
        loader.dispose()


class _Loader(yaml.SafeLoader):
    """Loader that checks each event while nodes are composed, to avoid a slow second pass."""

    def __init__(self, path: Path, text: str, most_items: int) -> None:
        super().__init__(text)
        self._path, self._most_items = path, most_items
        self._within: list[type[yaml.Event]] = []
        self._items = 0

    def get_event(self) -> yaml.Event:
        event: yaml.Event = super().get_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.CollectionEndEvent):
            self._within.pop()
        elif isinstance(event, yaml.NodeEvent):
            self._items += self._within[-1:] == [yaml.SequenceStartEvent]
        if isinstance(event, yaml.CollectionStartEvent):
            self._within.append(type(event))
        for found, most, what in (
            (len(self._within), MAX_DEPTH, "levels of nesting"),
            (self._items, self._most_items, "items in its lists, all together: shorten them"),
        ):
            if found > most:
                line = event.start_mark.line + 1 if event.start_mark else None
                raise InputError(self._path, f"more than {most} {what}", line)
        if isinstance(event, yaml.NodeEvent):
            _refuse_sigils(self._path, event)
        return event


def _refuse_sigils(path: Path, event: yaml.NodeEvent) -> None:
    """Reject aliases (*), anchors (&) and tags (!), which are text without its quotes here."""
    tag = getattr(event, "tag", None)
    if isinstance(event, yaml.AliasEvent):
        what = f"*{event.anchor} is an alias"
    elif event.anchor is not None:
        what = f"&{event.anchor} is an anchor"
    elif tag is not None:
        what = f"{tag.replace(_PREFIX, '!!')} is a tag"
    else:
        return
    line = event.start_mark.line + 1 if event.start_mark else None
    raise InputError(
        path, f"{what}, which has no use here: put text that begins with *, & or ! in quotes", line
    )


_EXPLANATIONS = {
    "'\\t'": "the line is indented with a tab: indent with spaces",
    "scanning an alias": "text that begins with * must be in quotes, such as '*.jpg'",
    "another document": "a second document (---) begins here: only one is allowed",
    "mapping values are not allowed": (
        "no colon is allowed here: put text that holds a colon in quotes, and check the indentation"
    ),
    "expected <block end>": (
        "this does not go on as the lines above: check its indentation, and quotes before it"
    ),
    "quoted scalar": "a quote is opened here and never closed",
    "<stream end>": "a bracket is opened here and never closed",
    "simple key": "expected 'key: value' here: is a colon, or the space after it, missing?",
    "cannot start any token": "text that begins with one of % @ ` must be in quotes",
}


def _explain(fault: yaml.MarkedYAMLError) -> str:
    """Return a parser error in plain words."""
    problem = f"{fault.problem or ''} ({fault.context or 'here'})"
    plain = (text for part, text in _EXPLANATIONS.items() if part in problem)
    return next(plain, f"is not valid YAML: {problem}")


class _Builder:
    """Converter of YAML nodes to plain data, which records lines and faults."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines: dict[KeyPath, int] = {}
        self.faults: list[tuple[int, str]] = []

    def build(self, node: yaml.Node, at: KeyPath) -> Plain:
        self.lines.setdefault(at, _line(node))
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, at)
        if isinstance(node, yaml.SequenceNode):
            return [self.build(item, (*at, i)) for i, item in enumerate(node.value)]
        # PyYAML resolves a plain scalar by the rules of YAML 1.1: resolve its text again.
        self._refuse_unseen(str(node.value), format_key_path(at), node)
        is_quoted = isinstance(node, yaml.ScalarNode) and node.style is not None
        return str(node.value) if is_quoted else resolve_scalar(str(node.value))

    def _refuse_unseen(self, text: str, what: str, node: yaml.Node) -> None:
        if fault := find_unshowable(
            "".join(text.split())
        ):  # a text of several lines may be intended
            self.faults.append((_line(node), f"{what}: holds {fault}: type it again"))

    def _mapping(self, node: yaml.MappingNode, at: KeyPath) -> dict[str, Plain]:
        result: dict[str, Plain] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                place = format_key_path(at) or "the file"
                raise InputError(self.path, f"{place}: a key must be plain text", _line(key_node))
            self._refuse_unseen(
                str(key_node.value), f"a key of {format_key_path(at) or 'the file'}", key_node
            )
            key = key_node.value  # the text as written: keys such as `no` or `1` stay text
            if key in result:
                first = self.lines[(*at, key)]
                self.faults.append(
                    (
                        _line(key_node),
                        f"{format_key_path((*at, key))}: is given twice, first in line {first}: "
                        f"keep one of the two",
                    )
                )
                continue
            self.lines[(*at, key)] = _line(key_node)
            result[key] = self.build(value_node, (*at, key))
        return result


_RESOLVERS: tuple[tuple[re.Pattern[str], Callable[[str], Plain]], ...] = (
    (re.compile(r"~|null|Null|NULL|"), lambda _: None),
    (re.compile(r"true|True|TRUE"), lambda _: True),
    (re.compile(r"false|False|FALSE"), lambda _: False),
    (re.compile(r"[-+]?(0|[1-9][0-9]{0,17})"), int),
    (re.compile(r"[-+]?((0|[1-9][0-9]*)(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?"), float),
)


def resolve_scalar(written: str) -> Plain:
    """Convert an unquoted scalar by YAML 1.2.2, section 10.3.2, decimal and finite numbers only.

    In addition, an unambiguous decimal comma (``1,5``) makes a number. Other texts stay text
    (``010``, ``12:30``, ``.nan``, ``0x10``, ``1_000``), so that they are rejected where a number is
    required, with the text in the message.
    """
    for pattern, convert in _RESOLVERS:
        if pattern.fullmatch(pointed := replace_decimal_comma(written)):
            value = convert(pointed)
            is_infinite = isinstance(value, float) and math.isinf(value)
            return written if is_infinite else value
    return written


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1


def format_key_path(key_path: KeyPath) -> str:
    """Write a key path in dotted notation: ``telemetry.position_sigma_m[0]``."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key_path)
    return text.removeprefix(".")


WIDTH = 110
"""Largest number of characters in a written line."""


class _Dumper(yaml.SafeDumper):
    """Writer that puts a text in quotes where `resolve_scalar` would not read it as text."""


_Dumper.add_representer(
    str,
    lambda dumper, text: dumper.represent_scalar(
        f"{_PREFIX}str", text, style=None if resolve_scalar(text) == text else '"'
    ),
)


def yaml_text(data: Plain, *, in_blocks: bool = False) -> str:
    """Write plain data as YAML, in its order.

    Parameters
    ----------
    data
        What is to be written.
    in_blocks
        Whether the innermost lists and mappings have a line for each entry, too.
    """
    text: str = yaml.dump(
        data,
        Dumper=_Dumper,
        sort_keys=False,
        allow_unicode=True,
        width=WIDTH,
        default_flow_style=False if in_blocks else None,
    )
    return text


def plain_settings(value: object) -> Plain:
    """Return settings as plain data, without the values of data classes that are their defaults.

    One text of several possible ones is written without a list, as by people.
    """
    if is_dataclass(value):
        return {
            one.name: plain_settings(getattr(value, one.name))
            for one in fields(value)
            if getattr(value, one.name) != _default(one)
        }
    if isinstance(value, Mapping):
        return {name: plain_settings(one) for name, one in value.items()}
    if isinstance(value, tuple):
        each = [plain_settings(one) for one in value]
        return each[0] if len(each) == 1 and isinstance(each[0], str) else each
    if isinstance(value, str | int | float | bool) or value is None:
        return value
    raise TypeError(f"{type(value).__name__} has no place in a YAML file")


def _default(one: Any) -> object:  # noqa: ANN401  (a field of any class)
    if one.default is not MISSING:
        return one.default
    return one.default_factory() if one.default_factory is not MISSING else MISSING
