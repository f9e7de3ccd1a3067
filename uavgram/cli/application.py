"""Application that the commands register with, and their common options and exit statuses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from cyclopts import App, Parameter, Token, validators

from uavgram.model.limits import comma_question, replace_decimal_comma


def decimal(_type: object, tokens: Sequence[Token]) -> float:
    """Read a typed number, with a decimal comma where it is unambiguous."""
    typed = tokens[0].value
    try:
        return float(replace_decimal_comma(typed))
    except ValueError:
        raise ValueError(f"must be a number (got {typed!r}){comma_question(typed)}") from None


Decimal = Annotated[float, Parameter(converter=decimal)]
Flag = Annotated[bool, Parameter(negative=())]
Verbose = Annotated[bool, Parameter(name=["--verbose", "-v"], negative=())]
Seed = Annotated[int, Parameter(validator=validators.Number(gte=0))]

Json = Annotated[bool, Parameter(name="--json", negative=())]

DONE, PROBLEM, WRONG_USAGE, VERDICT = 0, 1, 2, 3
QUIET = "--quiet"
"""Option of every command, at any place before a `--`."""

app = App(
    name="uavgram",
    help="Ground measurements with honest uncertainties from a drone's photos, its flight log and "
    "a few taped lengths.\n\nWithout a command, `uavgram` opens a page in the browser that leads "
    "from a folder of photos to the report; so does `uavgram FOLDER`. A command wins over a folder "
    "of its name: `uavgram ./run` opens the folder.",
    help_epilogue="Every command takes --quiet: it writes nothing but problems, an amber or red "
    "verdict (one line on standard error), and what --json asks for. Exit status: 0 done, 1 a "
    "problem that you can solve, 2 wrong usage, 3 the verdict "
    "of `run --fail-on`, 130 stopped by Ctrl+C.",
    help_format="plaintext",
    version_flags=["--version"],
    print_error=False,  # `entry.called` reports every error in one form
    exit_on_error=False,
    suppress_keyboard_interrupt=False,
    result_action="return_value",
)
app.register_install_completion_command(
    help="Let the shell complete commands and options (bash, zsh, fish)."
)
