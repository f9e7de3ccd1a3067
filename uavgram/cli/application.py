"""The application that the commands register with, and what they share: options, exit status."""

from __future__ import annotations

from typing import Annotated

from cyclopts import App, Parameter, validators

Verbose = Annotated[bool, Parameter(name=["--verbose", "-v"], negative=())]
Seed = Annotated[int, Parameter(validator=validators.Number(gte=0))]

DONE, PROBLEM, WRONG_USAGE, INTERRUPTED = 0, 1, 2, 130

app = App(
    name="uavgram",
    help="Ground measurements with honest uncertainties from a drone's photos, its flight log and "
    "a few taped lengths.",
    help_format="plaintext",
    version_flags=["--version"],
    print_error=False,  # `entry.main` tells every error in one form
    exit_on_error=False,
    suppress_keyboard_interrupt=False,
    result_action="return_value",
)
