"""README and manual: every block is run or marked, every key, column and picture is there."""

from __future__ import annotations

import dataclasses
import importlib
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, get_args, get_type_hints

import pytest
from manual_pages import Block, ManualPage, manual_pages
from results_schema import results_schema

from uavgram.cli.entry import app
from uavgram.config.project import load_project
from uavgram.io.photos.pose_tables import read_pose_csv
from uavgram.io.tables.csv_tables import Columns
from uavgram.io.tables.known import (
    CONTROL_LINES_COLUMNS,
    KNOWN_COLUMNS,
    LINES_COLUMNS,
    read_control_lines,
    read_known,
    read_known_points,
    read_lines,
)
from uavgram.io.tables.measure import MEASURE_COLUMNS, read_measure
from uavgram.io.tables.picks import PICKS_COLUMNS, TIES_COLUMNS, read_picks, read_ties
from uavgram.model.observations import MEASUREMENT_FORMS
from uavgram.model.options import Project

LANGUAGES = {"sh", "python", "csv", "yaml", "text"}
MOST_WORDS, MOST_TERMS = 900, 80
PAGES = manual_pages()
TABLES = {
    "picks-csv": PICKS_COLUMNS,
    "lines-csv": LINES_COLUMNS,
    "measure-csv": MEASURE_COLUMNS,
    "known-csv": KNOWN_COLUMNS,
    "control-lines-csv": CONTROL_LINES_COLUMNS,
    "ties-csv": TIES_COLUMNS,
}
READERS: dict[str, Callable[[Path], object]] = {
    "image,label": read_picks,
    "image,tie": read_ties,
    "name,from": read_lines,
    "name,points": read_control_lines,
    "label,latitude_deg": read_known_points,
    "label,east_m": read_known_points,
}
"""By the first columns; tables of `name,kind` are of known things where they have a sigma."""


def blocks_of(language: str) -> list[Block]:
    return [
        block
        for page in PAGES
        for block in page.blocks
        if block.language == language and not block.why_not_run
    ]


def named(blocks: list[Block]) -> list[Any]:
    return [pytest.param(block, id=f"{block.page}-{k}") for k, block in enumerate(blocks)]


def page_of(name: str) -> ManualPage:
    return next(page for page in PAGES if page.name == name)


@pytest.fixture(scope="module")
def generated(repository: Path) -> Iterator[ModuleType]:
    """What writes the pages that follow from the program."""
    sys.path.insert(0, str(repository / "docs"))
    yield importlib.import_module("generated")
    sys.path.remove(str(repository / "docs"))


def test_every_block_is_of_a_language_that_is_run_or_is_marked() -> None:
    blocks = [block for page in PAGES for block in page.blocks]
    unknown = [
        (block.page, block.language)
        for block in blocks
        if block.language not in LANGUAGES and not block.why_not_run
    ]

    assert len(blocks) > 50
    assert unknown == []
    assert all(len(block.why_not_run) > 10 for block in blocks if block.why_not_run)


def test_a_block_without_a_mark_is_found_as_one_to_run() -> None:
    text = "# A\n\n<!-- not run: it opens a page -->\n```sh\na\n```\n\n  ```sh\n  b\n  ```\n"
    page = ManualPage("a.md", text + "\n```{toctree}\nc\n```\n")

    assert [(block.text, block.why_not_run) for block in page.blocks] == [
        ("a\n", "it opens a page"),
        ("b\n", ""),
    ]


@pytest.mark.parametrize("block", named(blocks_of("csv")))
def test_every_table_is_read(block: Block, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(block.text, encoding="utf-8")
    header = block.text.splitlines()[0].split(",")
    first = ",".join(header[:2])
    if first == "image,latitude_deg":
        read_pose_csv(path, "msl", None)
    elif first == "name,kind":
        (read_known if "sigma" in header else read_measure)(path)
    else:
        READERS[first](path)


@pytest.mark.parametrize("block", named(blocks_of("yaml")))
def test_every_part_of_a_project_is_valid(block: Block, tmp_path: Path) -> None:
    for name in ("control.csv", "check.csv", "flight.MRK"):
        (tmp_path / name).touch()
    path = tmp_path / "project.yaml"
    needed = "images: '*.jpg'\ncamera: auto\npicks: picks.csv\n"
    path.write_text(needed + block.text, encoding="utf-8")

    load_project(path, unfinished=True)


def test_the_readme_is_a_page() -> None:
    words = re.sub(r"<!--.*?-->", "", page_of("README.md").text).split()

    assert len(words) <= MOST_WORDS


def test_commands_that_pages_name_exist() -> None:
    exist = {name for name in app if not name.startswith("-")}
    for page in PAGES:
        code = "\n".join(re.findall(r"`+[^`]+`+", page.text))
        found = set(re.findall(r"\buavgram ([a-z]+)\b", code)) - {"import"}
        assert found <= exist, page.name


def test_files_that_pages_link_to_are_there(repository: Path) -> None:
    """Also where the site was not built, as on a host of repositories: `made` is written then."""
    for page in PAGES:
        for link in re.findall(
            r"\]\(([^)#\s]+)", re.sub(r"```.*?```", "", page.text, flags=re.DOTALL)
        ):
            target = (repository / page.name).parent / link
            if "://" not in link:
                assert target.exists(), (page.name, link)
                assert "made" not in target.parts, (page.name, link)


def test_a_page_on_example_files_leads_to_them() -> None:
    for page in PAGES:
        if page.folder == "configs" and page.name.startswith("docs/howto/"):
            assert "(../example-files.md)" in page.text, page.name


def test_every_key_of_a_project_has_an_entry(generated: ModuleType, repository: Path) -> None:
    text = (repository / "configs" / "project.yaml").read_text(encoding="utf-8")
    keys = {key.name: key for key in generated.keys_of(text)}

    assert set(keys_of_class(Project)) - set(keys) == set()
    above = {name for name in keys if any(other.startswith(f"{name}.") for other in keys)}
    assert {key.name for key in keys.values() if not key.example} == above


def keys_of_class(options: type) -> Iterator[str]:
    """Keys of a project file, from the classes that check it."""
    hints = get_type_hints(options)
    for field in dataclasses.fields(options):
        yield field.name
        inner = (hints[field.name], *get_args(hints[field.name]))
        if field.name not in ("targets", "areas", "origin"):  # examples in one line
            for one in filter(dataclasses.is_dataclass, inner):
                assert isinstance(one, type)
                yield from (f"{field.name}.{name}" for name in keys_of_class(one))


def test_every_column_of_a_table_has_an_entry() -> None:
    text = page_of("docs/reference/tables.md").text
    for anchor, columns in TABLES.items():
        assert isinstance(columns, Columns)
        section = text.split(f"({anchor})=\n")[1].split("\n(", maxsplit=1)[0]
        rows = {word for row in re.findall(r"^\| (`.*?) \|", section, re.MULTILINE)
                for word in re.findall(r"`(\w+)`", row)}  # fmt: skip
        assert set(columns.known) - rows == set(), anchor
    kinds = set(re.findall(r"`(\w+)`", text))
    assert set(MEASUREMENT_FORMS) <= kinds


def keys_in(schema: Any, node: Any, path: str = "") -> Iterator[str]:  # noqa: ANN401  (JSON)
    """Keys that a JSON Schema allows, in every alternative: `[]` for items, `.*` for any name."""
    if "$ref" in node:
        inner = schema
        for part in node["$ref"].removeprefix("#/").split("/"):
            inner = inner[part]
        yield from keys_in(schema, inner, path)
    for choice in (*node.get("anyOf", ()), *node.get("oneOf", ()), *node.get("allOf", ())):
        yield from keys_in(schema, choice, path)
    for name, child in node.get("properties", {}).items():
        full = f"{path}.{name}".removeprefix(".")
        yield full
        yield from keys_in(schema, child, full)
    for items in (node.get("items"), *node.get("prefixItems", ())):
        yield from keys_in(schema, items, f"{path}[]") if isinstance(items, dict) else ()
    named = node.get("additionalProperties")
    yield from keys_in(schema, named, f"{path}.*") if isinstance(named, dict) else ()


def test_every_key_of_the_results_and_every_command_has_an_entry(generated: ModuleType) -> None:
    commands = generated.commands()
    rows = re.findall(r"^\| `(.+?)` \| (.*?) \|", generated.result_keys(), re.MULTILINE)
    schema = results_schema()
    keys = set(keys_in(schema, schema))

    assert {"measurements[].sigma", "verdict.reasons[].plain", "checks[].label"} < keys
    assert keys - {name for name, _ in rows} == set()
    assert {name for name, _ in rows} - keys == set()
    assert [name for name, kind in rows if not kind.strip()] == []
    for name in (name for name in app if not name.startswith("-")):
        assert f"\n## uavgram {name}\n" in commands


def test_the_glossary_is_short_and_in_order() -> None:
    rows = re.findall(r"^\| (.+?) \| (.+?) \|", page_of("docs/glossary.md").text, re.MULTILINE)[2:]

    assert 60 <= len(rows) <= MOST_TERMS
    assert len({term for term, _ in rows}) == len(rows)
    assert all(word.strip() for _, word in rows)
