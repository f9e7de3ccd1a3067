"""Command `uavgram explain`."""

from __future__ import annotations

from uavgram.cli.application import DONE, Flag, app
from uavgram.cli.terminal import print_unchanged


@app.command
def explain(code: str | None = None, /, *, markdown: Flag = False) -> int:
    """Explain a message: the finding, its consequence, its effect on the verdict, and the action.

    Parameters
    ----------
    code
        Code behind the message, such as pick-suspect. Without it, all codes are listed.
    markdown
        Print all entries as a page in Markdown.
    """
    from uavgram.views.explanations import explanation, list_codes, messages_page

    if markdown:
        print_unchanged(messages_page().removesuffix("\n"))
    else:
        print_unchanged(*(list_codes() if code is None else explanation(code)))
    return DONE
