"""All commands, and the form of error messages."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from difflib import get_close_matches
from itertools import islice
from pathlib import Path

import cyclopts

from uavgram.cli.application import DONE, PROBLEM, QUIET, WRONG_USAGE, app
from uavgram.cli.commands import (  # noqa: F401  (each registers its commands with the application)
    cameras,
    explain,
    exports,
    log,
    picks,
    plan,
    shortcut,
    simulations,
    surveys,
)
from uavgram.cli.interrupt import was_interrupted
from uavgram.cli.terminal import be_quiet, convert_units, drop_output, set_units
from uavgram.errors import UavgramError
from uavgram.model.naming import METRIC

__all__ = ["app", "run_command"]


def run_command(arguments: Sequence[str] | None) -> int:
    """Run the command in the arguments, or the process's own; return its exit status."""
    set_units(METRIC)
    typed = sys.argv[1:] if arguments is None else list(arguments)
    options = typed[: typed.index("--")] if "--" in typed else typed
    be_quiet(quiet=QUIET in options)
    rest = [one for one in options if one != QUIET] + typed[len(options) :]
    try:
        try:
            status = app(_add_command(rest))
        except Exception as fault:
            if was_interrupted():  # the fault is of a library interrupted by Ctrl+C
                raise KeyboardInterrupt from fault
            raise
    except cyclopts.CycloptsError as error:
        sys.stderr.write(f"uavgram: {_describe_wrong_use(error)}\n")
        return WRONG_USAGE
    except UavgramError as error:
        sys.stderr.write(convert_units(f"uavgram: {error}\n"))
        return PROBLEM
    except BrokenPipeError:  # the reader of the output (head, less) ended; files are written
        drop_output()
        return DONE
    return status if isinstance(status, int) else DONE


def _add_command(typed: list[str]) -> list[str]:
    """Open the page without a command: `uavgram`, `uavgram FOLDER`, `uavgram --port 8000`.

    A command takes precedence over a folder of its name.
    """
    if typed and (typed[0] in app or not (typed[0].startswith("-") or Path(typed[0]).exists())):
        return typed
    return ["pick", *typed]


def _describe_wrong_use(error: cyclopts.CycloptsError) -> str:
    """Describe the wrong use of a command, and the way to its help."""
    said = str(error)
    if isinstance(error, cyclopts.UnknownCommandError) and not error.command_chain:
        said = _describe_unknown_word((error.unused_tokens or [""])[0])
    elif isinstance(error, cyclopts.UnusedCliTokensError):
        typed = ", ".join(map(repr, error.unused_tokens or ()))
        said = f"{typed}: this command does not take that; it may need its option before it"
    elif isinstance(error, cyclopts.MissingArgumentError) and error.argument is not None:
        said = f"{error.argument.name} is missing"
        if error.argument.name.startswith("-"):
            choices = " or ".join(error.argument.get_choices(force=True) or ())
            is_typed = error.argument.name in (error.root_input_tokens or ())
            need = "takes a value after it" if is_typed else "is missing: state it, with its value"
            said = f"{error.argument.name} {need}{choices and f': {choices}'}"
    elif isinstance(error, cyclopts.CoercionError) and error.target_type is int and error.token:
        said = f"{error.token.keyword} takes a whole number, not {error.token.value!r}"
    command = " ".join(("uavgram", *(error.command_chain or ())))
    return f"{said}\nTry: {command} --help"


def _describe_unknown_word(typed: str) -> str:
    """Return the error text for a word that is neither a command nor a path, with similar names."""
    commands = [one for one in app if not one.startswith("-")]
    near = get_close_matches(typed, commands, cutoff=SIMILARITY)
    path = Path(typed)
    with suppress(OSError, ValueError):
        inside = {one.name.casefold(): one for one in islice(path.parent.iterdir(), MAX_ENTRIES)}
        for name in get_close_matches(path.name.casefold(), inside, cutoff=SIMILARITY):
            near.append(str(path.parent / inside[name].name))
    meant = f". Did you mean {' or '.join(near)}?" if near else ""
    return f"{typed!r} is neither a command nor a folder or file{meant}"


SIMILARITY = 0.6
"""Similarity from 0 to 1 above which a name is proposed for a mistyped one."""
MAX_ENTRIES = 5000
