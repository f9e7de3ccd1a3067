"""The command line: arguments -> one call of the pipeline -> exit status; one file per command.

Hardly anything is loaded here: before `main` is at work, Python answers Ctrl+C in its own way.
"""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: "Sequence[str] | None" = None) -> int:
    """Run the command line and return its exit status.

    0: done; 1: a problem that the user can solve, told in one message; 2: wrong usage; 130:
    interrupted by Ctrl+C, at whatever moment. Anything else is a bug and keeps its traceback.

    Parameters
    ----------
    arguments
        None: those of this process, which is ours alone then.
    """
    try:
        from uavgram.cli.start import begin

        return begin(arguments)
    except KeyboardInterrupt:
        from uavgram.cli.interrupt import report_interruption

        return report_interruption()
