"""The command line: arguments -> one call of the pipeline -> exit status; one file per command."""

from uavgram.cli.application import app
from uavgram.cli.entry import main

__all__ = ["app", "main"]
