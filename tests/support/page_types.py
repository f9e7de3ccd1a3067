"""Types of all messages for the page's JavaScript (connection/protocol.d.ts).

Those of the server are the typed dictionaries of `messages`, those of the page the commands that
`parse` reads. The file is made anew by each check (.ci/page/check) and is part of neither the
repository nor the package.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from types import UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    Never,
    NotRequired,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from uavgram.imaging.photos.preview import Tone
from uavgram.model.naming import Units
from uavgram.model.observations import MeasurementKind, Source
from uavgram.picking.document import commands as c
from uavgram.picking.document.state import Line
from uavgram.picking.protocol import messages
from uavgram.picking.protocol.parse import KINDS
from uavgram.pipeline.setup import FoundCamera, FoundPhotos

PATH = Path(__file__).parents[2] / ".ci" / "page" / "types" / "connection" / "protocol.d.ts"

HEAD = (
    "// Messages between page and server, as JSON: written by "
    "`python tests/support/page_types.py`.\n"
)
_INNER_COMMANDS = {c.PlaceAll}
"""Commands that the server makes itself."""

_DATA_CLASSES = (Units, Line, Tone, FoundPhotos, FoundCamera)
_ON_THE_WIRE: Mapping[Any, Any] = {
    "image": int,
    "from_image": int | None,
    "images": list[int],
    "pairs": list[messages.Pair],
    "parameters": dict[str, float],
    (c.Swap, "image"): int | None,
}
"""Fields of commands that have another form in messages: photos are numbers there."""

_OF_EVERY_COMMAND = "step?: number; final?: boolean"
_SCALARS: Mapping[Any, str] = {
    str: "string",
    int: "number",
    float: "number",
    bool: "boolean",
    type(None): "null",
    Never: "undefined",
    Callable: "string",  # text of a number, which is called before it is sent
}


def page_types() -> str:
    """Return the text of protocol.d.ts."""
    types_of_page = _PageTypes()
    declared = vars(messages).values()
    return "\n".join(
        (
            HEAD,
            *(types_of_page.alias(name, union) for union, name in types_of_page.named.items()),
            *(types_of_page.record(one) for one in declared if _is_own(one)),
            *map(types_of_page.record, (*_DATA_CLASSES, *types_of_page.kind_of)),
        )
    )


def _is_own(declared: object) -> bool:
    return is_typeddict(declared) and getattr(declared, "__module__", "") == messages.__name__


class _PageTypes:
    """Writer of types; `named` are unions with a name of their own, `kind_of` the commands."""

    def __init__(self) -> None:
        self.kind_of = {command: kind for kind, command in KINDS.items()}
        aliases = {name: one for name, one in vars(messages).items() if isinstance(one, UnionType)}
        del aliases["Text"]
        self.named: dict[Any, str] = {union: name for name, union in aliases.items()}
        self.named |= {
            c.SingleChange: "SingleChange",
            c.Command | c.Accept: "Change",
            c.Question | c.ProjectAction: "Question",
            MeasurementKind: "Kind",
            Source: "Source",
            c.Target: "Target",
            c.Work: "Work",
        }

    def alias(self, name: str, union: Any) -> str:  # noqa: ANN401  (a type)
        """Return the declaration of a union with a name."""
        return f"export type {name} = {self._unnamed(union)};"

    def record(self, declared: type) -> str:
        """Return the interface of a typed dictionary, a data class or a command."""
        hints = get_type_hints(declared, include_extras=True)
        fields = [self._field(declared, *one) for one in hints.items()]
        if declared in self.kind_of:
            fields[:0] = [f't: "{self.kind_of[declared]}"', _OF_EVERY_COMMAND]
        comment = " ".join((declared.__doc__ or "").partition("\n\n")[0].split())
        comment = f"// {comment}\n" if comment else ""
        return f"{comment}export interface {declared.__name__} {{ {'; '.join(fields)} }}"

    def _field(self, declared: type, name: str, hint: Any) -> str:  # noqa: ANN401  (a type)
        may_lack = name in getattr(declared, "__optional_keys__", ())
        if get_origin(hint) is NotRequired:
            may_lack, (hint,) = True, get_args(hint)
        if declared in self.kind_of:
            may_lack = hasattr(declared, name)  # it has a default
            hint = _ON_THE_WIRE.get((declared, name), _ON_THE_WIRE.get(name, hint))
        name = name if name.isidentifier() else json.dumps(name)
        return f"{name}{'?' * may_lack}: {self.type(hint)}"

    def type(self, hint: Any) -> str:  # noqa: ANN401  (a type)
        """Return a type of JavaScript, by its name where it has one."""
        return self.named.get(hint) or self._unnamed(hint)

    def _unnamed(self, hint: Any) -> str:  # noqa: ANN401  (a type)
        origin, arguments = get_origin(hint), get_args(hint)
        if origin is Annotated:  # JSON of a data class
            return self.type(hint.__metadata__[0])
        if origin is dict:
            value = self.type(arguments[1])
            return f"Record<string, {value}{'' if arguments[1] in _SCALARS else ' | undefined'}>"
        if origin is list or arguments[1:] == (Ellipsis,):
            inner = self.type(arguments[0])
            return f"({inner})[]" if " | " in inner else f"{inner}[]"
        if origin is tuple:
            return f"[{', '.join(map(self.type, arguments))}]"
        if origin in {Union, UnionType, Literal}:
            parts = (one for one in arguments if one not in _INNER_COMMANDS)
            names = map(json.dumps if origin is Literal else self.type, parts)
            return " | ".join(dict.fromkeys(names))
        return _SCALARS.get(origin or hint) or str(hint.__name__)


def main() -> None:
    """Write protocol.d.ts."""
    PATH.parent.mkdir(parents=True, exist_ok=True)
    PATH.write_text(page_types(), encoding="utf-8")


if __name__ == "__main__":
    main()
