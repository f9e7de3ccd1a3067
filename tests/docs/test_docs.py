"""The pages in docs/ are true of the code: paths, names, rooms and contracts exist."""

import ast
import importlib
import re
import sys
import tomllib
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest

PAGES = (
    *("architecture.md", "CONTRIBUTING.md", "CHANGELOG.md", "messages.md", "windows.md"),
    "background/choices.md",
)
SUFFIXES = "py|js|md|toml|yaml|html|css|jpg|typed"
PATH = re.compile(rf"^\.?[\w\-]+(/[\w\-.]+)*(/|\.({SUFFIXES}))$")
"""`io/tables/` or `io/tables/picks.py`: with a slash, or with the suffix of a source file."""
AT_WORK = {
    *("results.json", "calibration.json", "run.jsonl", "report.html", "report-annex.html"),
    "project.yaml",
}
"""Files that a run reads or writes, not those of the repository."""


def quoted(text: str) -> list[str]:
    """What stands between backticks, outside code blocks."""
    return re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL))


def named_in(text: str) -> Iterator[tuple[str, str]]:
    """(path, name in it) of everything quoted that is a path; the name may be empty."""
    for word in quoted(text):
        path, _, name = word.partition(":")
        if PATH.match(path) and path not in AT_WORK:
            yield path, name


def found(root: Path, path: str) -> Path | None:
    """The file or folder that a page calls `path`: in the package or in the repository."""
    return next((p for p in (root / "uavgram" / path, root / path) if p.exists()), None)


@cache
def python_names(file: Path) -> set[str]:
    """Functions, classes and constants of a module; ``Class.method`` for what is inside a class."""
    names = set()

    def collect(body: Sequence[ast.stmt], before: str) -> None:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                names.add(before + node.name)
            if isinstance(node, ast.ClassDef):
                collect(node.body, f"{before}{node.name}.")
            targets = node.targets if isinstance(node, ast.Assign) else []
            targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
            for target in targets:
                parts = target.elts if isinstance(target, ast.Tuple) else [target]
                names.update(before + part.id for part in parts if isinstance(part, ast.Name))

    collect(ast.parse(file.read_text(encoding="utf-8")).body, "")
    return names


def has_name(file: Path, name: str) -> bool:
    if file.suffix == ".py":
        return name in python_names(file)
    return re.search(rf"\b{re.escape(name)}\b *[(=]", file.read_text(encoding="utf-8")) is not None


def wrong_paths(text: str, root: Path) -> list[str]:
    """What a page names and the tree does not have."""
    wrong = []
    for path, name in named_in(text):
        file = found(root, path)
        if file is None or (name and not (file.is_file() and has_name(file, name))):
            wrong.append(f"{path}:{name}" if name else path)
    return wrong


def wrong_modules(text: str) -> list[str]:
    """Dotted names that cannot be imported."""
    wrong = []
    for dotted in set(re.findall(r"\buavgram(?:\.\w+)+", text)):
        owner, _, name = dotted.rpartition(".")
        try:
            importlib.import_module(dotted)
        except ImportError:
            try:
                getattr(importlib.import_module(owner), name)
            except (ImportError, AttributeError):
                wrong.append(dotted)
    return wrong


@pytest.fixture(params=PAGES)
def page(request: pytest.FixtureRequest, repository: Path) -> str:
    result: str = (repository / "docs" / request.param).read_text(encoding="utf-8")
    return result


@pytest.fixture
def architecture(repository: Path) -> str:
    return (repository / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_every_path_and_name_on_a_page_exists(page: str, repository: Path) -> None:
    assert wrong_paths(page, repository) == []


def test_every_module_that_a_page_names_can_be_imported(page: str) -> None:
    assert wrong_modules(page) == []


def test_what_does_not_exist_is_noticed(repository: Path) -> None:
    text = "`io/tables/picks.py:read_pics` `io/desk/` `picking/page/store.js:recieve` `nowhere.py`"
    good = "`io/tables/picks.py:read_picks` `picking/storage/journal.py:Journal.record` `io/`"

    assert wrong_paths(f"{text} {good}", repository) == [
        "io/tables/picks.py:read_pics",
        "io/desk/",
        "picking/page/store.js:recieve",
        "nowhere.py",
    ]
    assert wrong_modules("uavgram.stages.rectify, uavgram.run") == ["uavgram.stages.rectify"]


def test_every_path_that_a_docstring_names_exists(repository: Path) -> None:
    package = repository / "uavgram"
    floors = "|".join(sorted(init.parent.name for init in package.glob("*/__init__.py")))
    named = re.compile(rf"(?<![\w/.])(?:{floors})/[\w/]+\.py\b")
    wrong = [
        f"{file.relative_to(package)}: {path}"
        for file in package.rglob("*.py")
        for path in named.findall(file.read_text(encoding="utf-8"))
        if not (package / path).is_file()
    ]

    assert wrong == []


def test_links_between_the_pages_lead_somewhere(page: str, repository: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)", page):
        if "://" not in target:
            assert (repository / "docs" / target).exists(), target


@pytest.fixture(scope="module")
def drawings(repository: Path) -> Iterator[ModuleType]:
    """What draws the pictures of the manual."""
    pytest.importorskip("matplotlib")
    sys.path.insert(0, str(repository / "docs"))
    yield importlib.import_module("drawings")
    sys.path.remove(str(repository / "docs"))


def test_the_picture_has_every_room_and_its_arrows_point_down(
    drawings: ModuleType, repository: Path, architecture: str, tmp_path: Path
) -> None:
    rooms = {init.parent.name for init in (repository / "uavgram").glob("*/__init__.py")}
    floor = {room: k for k, floor in enumerate(drawings.floors()) for room in floor}
    imports, arrows = drawings.imports_between_rooms(), drawings.direct_arrows()

    assert set(floor) == rooms == set(drawings.PURPOSES)
    assert all(floor[start] < floor[end] for start, end in arrows)
    assert {"stages", "views", "io"} <= imports["pipeline"]
    for start, others in imports.items():  # each import is an arrow, or a way along arrows
        reached, new = set(), {start}
        while new:
            reached |= new
            new = {end for begin, end in arrows if begin in new} - reached
        assert others <= reached
    drawings.draw(tmp_path)
    assert (tmp_path / "rooms.svg").is_file()
    assert "`background/made/rooms.svg`" in architecture


def contracts_of(repository: Path) -> list[str]:
    project = tomllib.loads((repository / "pyproject.toml").read_text(encoding="utf-8"))
    return [one["name"] for one in project["tool"]["importlinter"]["contracts"]]


def test_the_page_has_every_import_contract_and_no_other(
    architecture: str, repository: Path
) -> None:
    section = architecture.split("## Import contracts")[1].split("\n## ", maxsplit=1)[0]
    rows = [line.split("|")[1].strip() for line in section.splitlines() if line.startswith("| ")]
    contracts = contracts_of(repository)

    assert rows[2:] == contracts
    assert len(set(contracts)) == len(contracts)


def test_pre_commit_runs_the_checks_that_ci_runs(repository: Path) -> None:
    script = (repository / ".ci" / "run").read_text(encoding="utf-8")
    hooks = (repository / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    checks = re.findall(r"^(\.venv/bin/(?!python|pytest).+|\.ci/.+)$", script, flags=re.MULTILINE)

    assert len(checks) >= 5
    for check in checks:
        assert f"entry: {check}\n" in hooks


def test_the_package_says_that_it_is_typed(repository: Path) -> None:
    assert (repository / "uavgram" / "py.typed").is_file()


def test_no_page_names_a_place_on_one_machine(page: str) -> None:
    assert re.findall(r"(?<![\w.])/(?:work|home|tmp|root)\b", page) == []


def public_functions(owner: ast.Module | ast.ClassDef) -> Iterator[ast.FunctionDef]:
    """Functions and methods of a module or class that others may call."""
    for one in owner.body:
        if isinstance(one, ast.FunctionDef) and not one.name.startswith("_"):
            yield one
        if isinstance(one, ast.ClassDef) and not one.name.startswith("_"):
            yield from public_functions(one)


def test_public_functions_with_three_arguments_describe_them(repository: Path) -> None:
    files = sorted((repository / "uavgram").rglob("*.py"))
    parsed = ((path, ast.parse(path.read_text(encoding="utf-8"))) for path in files)
    found = [(path, function) for path, tree in parsed for function in public_functions(tree)]
    assert len(found) > 500
    bare = [
        f"{path.relative_to(repository)}:{function.lineno} {function.name}"
        for path, function in found
        if len(
            {one.arg for one in (*function.args.args, *function.args.kwonlyargs)} - {"self", "cls"}
        )
        >= 3
        and "Parameters\n" not in (ast.get_docstring(function) or "")
    ]
    assert not bare
