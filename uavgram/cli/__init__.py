"""The command line: arguments -> one call of the pipeline -> exit status; one file per command."""

from uavgram.cli.start import main

__all__ = ["main"]
