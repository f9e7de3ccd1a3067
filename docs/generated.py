"""Pages and drawings of the manual that follow from the program: written before each build."""

from __future__ import annotations

import importlib
import inspect
import json
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]


def write(reference: Path, background: Path) -> None:
    """Write all generated pages into `reference`, all drawings into `background`."""
    reference.mkdir(exist_ok=True)
    background.mkdir(exist_ok=True)
    for name, text in {
        "commands": commands(),
        "project": project_keys(),
        "scenario": examples(),
        "results": result_keys(),
        "python": python_api(),
    }.items():
        _write(reference / f"{name}.md", text)
    pack_examples(reference / "uavgram-examples.zip")
    import drawings  # noqa: PLC0415  (loads matplotlib)

    drawings.draw(background)


def pack_examples(path: Path) -> None:
    """Pack the example files that how-to pages and scripts use, in their folders."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for folder in ("configs", "logs", "docs/examples"):
            for file in sorted((ROOT / folder).rglob("*")):
                made = {"out", "__pycache__"} & set(file.relative_to(ROOT).parts)
                if file.is_file() and not made:
                    archive.write(file, f"uavgram-examples/{file.relative_to(ROOT).as_posix()}")


def _write(path: Path, text: str) -> None:
    """Write a page only where it changed, so that Sphinx reads only what did."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def commands() -> str:
    """Return the page of commands, from their own help."""
    from uavgram.cli.entry import app  # noqa: PLC0415

    text: str = app.generate_docs(output_format="markdown")
    body = "## uavgram " + text.split("\n## uavgram ", maxsplit=1)[1]
    body = body.replace("```console\n", "```text\n").replace("**/", r"\*\*/")
    return f"# Commands\n\nThis page is made of the help that each command prints.\n\n{body}"


@dataclass(frozen=True)
class Key:
    """A key of project.yaml.

    Attributes
    ----------
    name
        With those above it: ``ground.height_m``.
    example
        Its value in configs/project.yaml.
    meaning
        The comment beside it.
    """

    name: str
    example: str
    meaning: str


def keys_of(text: str) -> list[Key]:
    """Return the keys of a commented project file, in their order; also those commented out."""
    keys: list[Key] = []
    above: list[tuple[int, str]] = []
    for line in text.splitlines():
        shown = re.sub(r"^# (?=\w+:)", "", line)
        found = re.match(r"^( *)([a-z_0-9]+):(.*)$", shown)
        if found:
            indent, name, rest = len(found[1]), found[2], found[3]
            above = [one for one in above if one[0] < indent]
            value, _, comment = rest.partition(" #")
            path = ".".join([*(parent for _, parent in above), name])
            keys.append(Key(path, value.strip(), comment.strip()))
            above.append((indent, name))
        elif keys and (more := re.match(r"^(?: +|# +)# *(.*)$", line)):
            last = keys[-1]
            keys[-1] = Key(last.name, last.example, f"{last.meaning} {more[1].strip()}".strip())
    return keys


def project_keys() -> str:
    """Return the page of project.yaml: every key, and the example that has them all."""
    text = (ROOT / "configs" / "project.yaml").read_text(encoding="utf-8")
    rows = [
        f"| `{key.name}` | {_code(key.example)} | {_cell(key.meaning)} |" for key in keys_of(text)
    ]
    return "\n".join(
        [
            "# project.yaml: every key",
            "",
            "Only `images`, `camera` and `picks` are required. Paths are relative to the file. The",
            "values are the defaults, except for names of files and `time.offset_s`.",
            "",
            "| key | value | meaning |",
            "| --- | --- | --- |",
            *rows,
            "",
            "## The whole file",
            "",
            "```{literalinclude} ../../../configs/project.yaml",
            ":language: yaml",
            "```",
            "",
        ]
    )


def _code(text: str) -> str:
    return f"`{text}`" if text else ""


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


def examples() -> str:
    """Return the page of the other files to copy, each whole."""
    parts = ["# Cameras, scenarios and plans: files to copy", ""]
    for path in sorted((ROOT / "configs").glob("*.yaml")):
        if path.name != "project.yaml":
            parts += [f"## {path.name}", "", f"```{{literalinclude}} ../../../configs/{path.name}"]
            language = "text" if path.stem == "camera_opencv" else "yaml"
            parts += [f":language: {language}", "```", ""]
    return "\n".join(parts)


Rows = dict[str, tuple[list[str], str]]
"""Types and meaning of each key."""


def result_keys() -> str:
    """Return the page of results.json, from its JSON Schema."""
    schema = json.loads((ROOT / "uavgram" / "results.schema.json").read_text(encoding="utf-8"))
    found: Rows = {}
    _rows_of(schema, "", schema, found)
    rows = [
        f"| `{key}` | {_cell(' or '.join(kinds))} | {_cell(' '.join(meaning.split()))} |"
        for key, (kinds, meaning) in found.items()
    ]
    head = [
        "# results.json: every key",
        "",
        'The JSON Schema is part of the package: `importlib.resources.files("uavgram") /',
        '"results.schema.json"`. `[]` marks the items of a list, `.*` any name. Units are in',
        "the names.",
        "",
        "| key | type | meaning |",
        "| --- | --- | --- |",
    ]
    return "\n".join([*head, *rows, ""])


def _rows_of(node: dict[str, Any], path: str, schema: dict[str, Any], rows: Rows) -> None:
    """Add the rows of what is inside a node, of all its alternatives; each key once."""
    for one in _alternatives(node, schema):
        for name, child in one.get("properties", {}).items():
            full = f"{path}.{name}" if path else name
            choices = _alternatives(child, schema)
            said = [child, *choices]
            meaning = next((text for some in said if (text := some.get("description"))), "")
            kinds = list(dict.fromkeys(filter(None, map(_type, choices))))
            before, said_before = rows.get(full, ([], ""))
            rows[full] = (list(dict.fromkeys([*before, *kinds])), said_before or meaning)
            _rows_of(child, full, schema, rows)
        for items in (one.get("items"), *one.get("prefixItems", ())):
            if isinstance(items, dict):
                _rows_of(items, f"{path}[]", schema, rows)
        if isinstance(named := one.get("additionalProperties"), dict):
            _rows_of(named, f"{path}.*", schema, rows)


def _alternatives(node: dict[str, Any], schema: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what a node may be: references and alternatives followed."""
    if "$ref" in node:
        target: Any = schema
        for part in node["$ref"].removeprefix("#/").split("/"):
            target = target[part]
        return _alternatives({**target, **{k: v for k, v in node.items() if k != "$ref"}}, schema)
    if choices := node.get("anyOf") or node.get("oneOf"):
        return [inner for one in choices for inner in _alternatives(one, schema)]
    return [node]


def _type(node: dict[str, Any]) -> str:
    kind = node.get("type", "")
    if "enum" in node or "const" in node:
        return ", ".join(f"`{one}`" for one in node.get("enum", [node.get("const")]))
    return " or ".join(kind) if isinstance(kind, list) else str(kind)


def python_api() -> str:
    """Return the page of the public Python names, from their docstrings."""
    import uavgram  # noqa: PLC0415

    parts = [
        "# Python: every public name",
        "",
        "`import uavgram` loads nothing heavy; each name is loaded when it is first used.",
        "[From Python](../../howto/python.md) shows them at work.",
        "",
    ]
    for name in uavgram.__all__:
        thing = getattr(uavgram, name)
        parts += [f"## uavgram.{name}", ""]
        if inspect.ismodule(thing):
            parts += [(inspect.getdoc(thing) or "").strip(), ""]
            for inner, function in inspect.getmembers(thing, inspect.isfunction):
                if function.__module__ == thing.__name__ and not inner.startswith("_"):
                    parts += _directive("autofunction", f"{thing.__name__}.{inner}")
        else:
            kind = "autoclass" if inspect.isclass(thing) else "autofunction"
            parts += _directive(kind, f"{thing.__module__}.{thing.__name__}")
    parts += ["## Tables of a result", ""]
    results = importlib.import_module("uavgram.model.result.result")
    hints = inspect.get_annotations(results.Result, eval_str=True)
    for field, kind in hints.items():
        if inspect.isclass(kind) and kind.__module__.startswith("uavgram.model"):
            parts += [f"### result.{field}", ""]
            parts += _directive("autoclass", f"{kind.__module__}.{kind.__name__}")
    return "\n".join(parts)


def _directive(kind: str, target: str) -> list[str]:
    return ["```{eval-rst}", f".. {kind}:: {target}", "```", ""]
