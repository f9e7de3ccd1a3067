"""The catalogue has an entry for each code of a message, and no other; docs/messages.md shows it.

The codes are read from the source: of every `Message(...)` in the package, what stands as its code.
Literals, constants, loops over literals and parameters of a helper are followed; what is put
together in another way stands in `MADE`, with the place that it is made of.
"""

import ast
import importlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from uavgram.estimation.survey.adjustment import Removal
from uavgram.estimation.survey.observations.kinds import KINDS
from uavgram.model.flight_log import FaultKind
from uavgram.model.message_catalogue import Effect, entries_by_code, list_subjects
from uavgram.views.explanations import messages_page

KINDS_REMOVED = set(get_args(get_type_hints(Removal)["kind"])) - {"mend"}
"""A mend has the code of the cause that it mends."""

MADE = {
    "stages/judge/suspects.py: observation.kind.misfit_code": {
        kind.misfit_code for kind in KINDS.values()
    },
    "stages/refine/remarks.py: f'{removal.kind}-removed'": {f"{k}-removed" for k in KINDS_REMOVED},
    "stages/seed/log_faults.py: f'log-{code}'": {f"log-{kind}" for kind in get_args(FaultKind)},
}
"""Codes that no rule below finds: where, and all that it can be."""

NO_MISFIT = (Effect.NONE, Effect.UNCHECKED)
"""Effects of a note: none, or a reason where the value of a measurement depends on it."""

EXPERT_TERMS = re.compile(
    r"\bw = |χ²|chi-square|variance factor|redundan|residual(?!s`)|(?<!`)telemetry"
    r"|(first|second)[- ]order|likelihood|estimator"
)
"""Terms of statistics that messages do without: their readers are no surveyors."""

UNRESOLVED = "unresolved"
CODE = re.compile(r"[a-z0-9]+(-[a-z0-9]+)+|misfit")


@dataclass(frozen=True)
class Source:
    """A module of the package.

    Attributes
    ----------
    path
        Below the package.
    text
        What it holds.
    """

    path: str
    text: str

    @property
    def module(self) -> str:
        return f"uavgram.{self.path.removesuffix('.py').replace('/', '.')}"

    def says(self) -> bool:
        """Whether it knows messages of the run; the picking page's protocol has others."""
        return "from uavgram.model.message import" in self.text

    def around(self, node: ast.expr) -> list[ast.FunctionDef]:
        """Functions that hold a node, the innermost first."""
        found = [
            one
            for one in nodes_of(self)
            if isinstance(one, ast.FunctionDef)
            and one.lineno <= node.lineno <= (one.end_lineno or 0)
        ]
        return sorted(found, key=lambda one: -one.lineno)


@cache
def nodes_of(source: Source) -> list[ast.AST]:
    kept = ast.Call | ast.FunctionDef
    return [node for node in ast.walk(ast.parse(source.text)) if isinstance(node, kept)]


@cache
def sources(package: Path) -> tuple[Source, ...]:
    return tuple(
        Source(path.relative_to(package).as_posix(), path.read_text(encoding="utf-8"))
        for path in sorted(package.rglob("*.py"))
    )


def name_of(call: ast.Call) -> str:
    """What is called: ``f(...)`` or ``a.f(...)``."""
    if isinstance(call.func, ast.Attribute):
        return call.func.attr
    return call.func.id if isinstance(call.func, ast.Name) else ""


def argument(call: ast.Call, name: str, place: int) -> ast.expr | None:
    """An argument of a call by its name, or at its place."""
    named = [word.value for word in call.keywords if word.arg == name]
    return named[0] if named else (call.args[place] if place < len(call.args) else None)


def calls_of(source: Source, function: str) -> Iterator[ast.Call]:
    if f"{function}(" in source.text:
        for node in nodes_of(source):
            if isinstance(node, ast.Call) and name_of(node) == function:
                yield node


def values_of(code: ast.expr, source: Source, all_sources: tuple[Source, ...]) -> set[str]:
    """All that an expression can be; empty where no rule tells."""
    if isinstance(code, ast.Constant):
        return {code.value} if isinstance(code.value, str) else set()
    if isinstance(code, ast.IfExp):
        either = [values_of(one, source, all_sources) for one in (code.body, code.orelse)]
        return either[0] | either[1] if all(either) else set()
    if not isinstance(code, ast.Name):
        return set()
    for function in source.around(code):
        if looped := in_loop(function, code.id):
            return looped
        names = [each.arg for each in function.args.args if each.arg != "self"]
        if code.id in names:
            place = names.index(code.id)
            users = [source] if function.name.startswith("_") else all_sources
            given = [
                (user, argument(call, code.id, place))
                for user in users
                for call in calls_of(user, function.name)
            ]
            found = [values_of(one, user, all_sources) if one else set() for user, one in given]
            return set().union(*found) if all(found) else set()
    constant = getattr(importlib.import_module(source.module), code.id, None)
    return {constant} if isinstance(constant, str) else set()


def is_handed_on(code: ast.expr) -> bool:
    """``message.code``, ``reason.cause``: the code of another message."""
    return isinstance(code, ast.Attribute) and code.attr in ("code", "cause")


def in_loop(function: ast.FunctionDef, name: str) -> set[str]:
    """Values of a variable of a loop over a table of literals."""
    for loop in (one for one in ast.walk(function) if isinstance(one, ast.For)):
        if isinstance(loop.target, ast.Tuple) and isinstance(loop.iter, ast.Tuple):
            names = [one.id if isinstance(one, ast.Name) else "" for one in loop.target.elts]
            if name in names:
                rows = ast.literal_eval(loop.iter)
                return {row[names.index(name)] for row in rows}
    return set()


def messages_of(package: Path) -> Iterator[tuple[str, set[str], set[str]]]:
    """Where (``file: expression``), codes and levels (or none) of each `Message(...)`."""
    everything = sources(package)
    for source in everything:
        if not source.says():
            continue
        changed = [call for call in calls_of(source, "replace") if argument(call, "code", 99)]
        for call in (*calls_of(source, "Message"), *changed):
            code, level = argument(call, "code", 1), argument(call, "level", 0)
            if code is not None and not is_handed_on(code):
                levels = values_of(level, source, everything) if level else set()
                where = f"{source.path}: {ast.unparse(code)}"
                found = values_of(code, source, everything)
                yield where, found, levels


@pytest.fixture
def said(repository: Path) -> list[tuple[str, set[str], set[str]]]:
    return list(messages_of(repository / "uavgram"))


def all_codes(said: list[tuple[str, set[str], set[str]]]) -> set[str]:
    """Codes of everything that is said; what has none stands for no message."""
    return set().union(*(codes or MADE.get(where, set()) for where, codes, _ in said)) - {""}


def test_every_code_in_the_source_is_found(said: list[tuple[str, set[str], set[str]]]) -> None:
    unresolved = {where for where, codes, _ in said if not codes}

    assert unresolved == MADE.keys()  # else add where, and what it can be
    codes = all_codes(said)
    assert len(codes) > 140
    assert [code for code in codes if not CODE.fullmatch(code)] == []


def test_the_catalogue_has_an_entry_for_every_code_and_no_other(
    said: list[tuple[str, set[str], set[str]]],
) -> None:
    entries = [entry.code for subject in list_subjects() for entry in subject.entries]

    assert all_codes(said) - set(entries) == set()
    assert set(entries) - all_codes(said) == set()
    assert len(entries) == len(set(entries))


def test_each_entry_has_the_levels_of_its_messages(
    said: list[tuple[str, set[str], set[str]]],
) -> None:
    of_code: dict[str, set[str]] = {}
    for where, codes, levels in said:
        for code in (codes or MADE[where]) - {""}:
            of_code.setdefault(code, set()).update(levels or {UNRESOLVED})
    unlike = {
        code for code, found in of_code.items() if set(entries_by_code()[code].levels) != found
    }

    assert unlike == {"weak-lengths"}  # its level depends on more than the source shows
    assert UNRESOLVED in of_code["weak-lengths"]


def test_the_page_is_that_of_the_catalogue(repository: Path) -> None:
    written = (repository / "docs" / "messages.md").read_text(encoding="utf-8")

    assert written == messages_page()  # else: uavgram explain --markdown > docs/messages.md
    subjects = re.findall(r"^## (.+)$", written, flags=re.MULTILINE)
    anchors = [re.sub(r"[^\w\- ]", "", one.lower()).replace(" ", "-") for one in subjects]
    assert re.findall(r"^- \[.+\]\(#(.+)\)", written, flags=re.MULTILINE) == anchors
    assert re.findall(r"^### (.+)$", written, flags=re.MULTILINE) == list(entries_by_code())


def test_every_entry_is_in_whole_sentences_with_an_action_where_one_is_due() -> None:
    for entry in entries_by_code().values():
        for text in (entry.finding, entry.consequence, entry.action):
            assert text == "" or re.fullmatch(r"[A-Z`](?!.*  ).*[.)]", text)
        assert entry.finding, entry.code
        assert entry.action or entry.levels == ("info",), entry.code


def literals_of(source: Source) -> Iterator[str]:
    """Texts in a module, without its docstrings."""
    tree = ast.parse(source.text)
    alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone:
            yield node.value


def test_messages_do_without_terms_of_statistics(repository: Path) -> None:
    """The glossary has a layman's word for each."""
    texts = {
        text
        for source in sources(repository / "uavgram")
        if source.says()
        for text in literals_of(source)
        if " " in text  # no key or code
    }
    for entry in entries_by_code().values():
        texts |= {entry.finding, entry.consequence, entry.action, entry.one, entry.several}

    assert [text for text in sorted(texts) if EXPERT_TERMS.search(text)] == []


def test_what_an_entry_refers_to_exists() -> None:
    for entry in entries_by_code().values():
        assert entry.part_of == "" or entries_by_code()[entry.part_of].effect is not Effect.NONE
        assert entry.effect in NO_MISFIT or entry.levels != ("info",), entry.code
        assert entry.one or not entry.several, entry.code
