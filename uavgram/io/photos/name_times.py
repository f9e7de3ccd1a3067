"""Times in the names of photos: the strptime format by which all of them can be read."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime

_MOMENT = re.compile(
    r"(?P<year>(?:19|20)\d\d)(?P<a>[-_.]?)(?P<month>[01]\d)(?P<b>[-_.]?)(?P<day>[0-3]\d)"
    r"(?P<c>[-_T. ]?)(?P<hour>[0-2]\d)(?P<d>[-_.h]?)(?P<minute>[0-5]\d)(?P<e>[-_.m]?)"
    r"(?P<second>[0-5]\d)(?P<f>\.?)(?P<fraction>\d{0,6})"
)


def name_format(stems: Sequence[str]) -> str | None:
    """The format of the times in the names of files.

    Parameters
    ----------
    stems
        Names without suffix.

    Returns
    -------
    str or None
        For strptime; None where not every name holds a time of one form, or two hold the same.
    """
    if not stems:
        return None
    match = _MOMENT.search(stems[0])
    if match is None:
        return None
    form = "%Y{a}%m{b}%d{c}%H{d}%M{e}%S".format(**match.groupdict())
    if match["fraction"]:
        form += f"{match['f']}%f"
        end = match.end()
    else:
        end = match.start("f")
    before, after = (
        part.replace("%", "%%") for part in (stems[0][: match.start()], stems[0][end:])
    )
    form = f"{before}{form}{after}"
    try:
        moments = {datetime.strptime(stem, form) for stem in stems}  # noqa: DTZ007  (compared only)
    except ValueError:
        return None
    return form if len(moments) == len(stems) else None
