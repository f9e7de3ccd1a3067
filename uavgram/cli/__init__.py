"""Command line: arguments -> one call of the pipeline -> exit status; commands by subject.

Hardly anything is loaded here: before `main` starts, Python handles Ctrl+C in its own way.
"""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: "Sequence[str] | None" = None) -> int:
    """Run the command line and return its exit status.

    0: done; 1: a problem that the user can solve, reported in one message; 2: wrong usage; 130:
    interrupted by Ctrl+C, at any moment. Anything else is a bug and keeps its traceback.

    Parameters
    ----------
    arguments
        None: those of this process, which then runs only this command.
    """
    try:
        from uavgram.cli.start import start

        return start(arguments)
    except KeyboardInterrupt:
        if arguments is None:  # it may have come before `start` watches, and comes once more
            import signal

            signal.signal(signal.SIGINT, signal.SIG_IGN)
        from uavgram.cli.interrupt import report_interruption

        return report_interruption()
