"""The entry point: every command, and the form in which errors are told."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import cyclopts

from uavgram.cli.application import DONE, INTERRUPTED, PROBLEM, WRONG_USAGE, app
from uavgram.cli.commands import (  # noqa: F401  (each registers itself with the application)
    batch,
    calibrate,
    camera,
    check,
    demo,
    geotag,
    log,
    new,
    pick,
    picks,
    picks_ties,
    plan,
    rectify,
    run,
    simulate,
    study,
    targets,
    view,
)
from uavgram.cli.terminal import as_told, drop_output, tell_in
from uavgram.errors import UavgramError
from uavgram.model.units import METRIC
from uavgram.pipeline.own_process import load_little, seldom_look_for_cycles


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    0: done; 1: a problem that the user can solve, told in one message; 2: wrong usage. Anything
    else is a bug and keeps its traceback.
    """
    # Most matrices here are small: more threads wait for each other longer than they help. numpy's
    # library reads this when a command loads it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Photos are looked at by threads of ours, as many as there are cores: those of OpenCV would
    # wait beside them, and waiting takes a core too. It reads this when it is loaded.
    os.environ.setdefault("OPENCV_FOR_THREADS_NUM", "1")
    # Of damaged photos OpenCV speaks in terms of its own source; our messages say what to do.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    # pydantic asks every installed package whether it has a plugin for it; we use none.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    if arguments is None:  # this process is ours alone
        load_little()
        seldom_look_for_cycles()
    tell_in(METRIC)
    try:
        status = app(arguments)
    except cyclopts.CycloptsError as error:
        sys.stderr.write(f"uavgram: {_wrong_use(error)}\n")
        return WRONG_USAGE
    except UavgramError as error:
        sys.stderr.write(as_told(f"uavgram: {error}\n"))
        return PROBLEM
    except BrokenPipeError:  # who reads our output has left (head, less): the files are written
        drop_output()
        return DONE
    except KeyboardInterrupt:
        sys.stderr.write("uavgram: interrupted; earlier results are as they were\n")
        return INTERRUPTED
    return status if isinstance(status, int) else DONE


def _wrong_use(error: cyclopts.CycloptsError) -> str:
    """What is wrong with a command as it was typed, and where to read how it is used."""
    said = str(error)
    if isinstance(error, cyclopts.UnusedCliTokensError):
        typed = ", ".join(map(repr, error.unused_tokens or ()))
        said = f"{typed}: this command does not take that; it may need its option before it"
    elif isinstance(error, cyclopts.MissingArgumentError) and error.argument is not None:
        said = f"{error.argument.name} is missing"
    elif isinstance(error, cyclopts.CoercionError) and error.target_type is int and error.token:
        said = f"{error.token.keyword} takes a whole number, not {error.token.value!r}"
    command = " ".join(("uavgram", *(error.command_chain or ())))
    return f"{said}\nTry: {command} --help"
