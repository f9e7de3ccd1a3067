"""Find the fault of each known length that does not fit; several lengths may share one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

from uavgram.estimation.reliability.stated_values import explain_length
from uavgram.model.arrays import Ints
from uavgram.model.observations import KnownLines
from uavgram.model.result.tables import LineResults


class LengthFault(NamedTuple):
    """Reason why lengths do not fit: one of these.

    Attributes
    ----------
    mistake
        Likely mistake of a reading, such as another unit; empty for none.
    end
        Point at which they end, which may be another one than was taped; empty for none.
    row
        The length itself, where nothing else is known.
    """

    mistake: str = ""
    end: str = ""
    row: int = -1


def find_length_faults(
    lines: KnownLines | LineResults, seen: Mapping[int, tuple[float, float]], fitting: Ints
) -> dict[int, LengthFault]:
    """Find the fault of each length that does not fit; several may have one.

    Parameters
    ----------
    lines
        All lengths.
    seen
        Row of each length that does not fit, with its adjusted value [m] and sigma.
    fitting
        Rows of the lengths that fit: their ends are right.
    """
    mistake = {
        i: explain_length(lines.length_m[i], lines.sigma_m[i], *adjusted)
        for i, adjusted in seen.items()
    }
    right = {end for i in fitting.tolist() for end in (lines.start[i], lines.end[i])}
    unknown = [i for i in seen if not mistake[i]]
    count = Counter(end for i in unknown for end in (lines.start[i], lines.end[i]))
    # One wrong point has to explain all of them: two lengths that meet always fit some other point.
    common = [end for end in count if 1 < count[end] == len(unknown) and end not in right]
    faults = {}
    for i in seen:
        if mistake[i]:
            faults[i] = LengthFault(mistake=mistake[i])
        elif len(common) == 1:
            faults[i] = LengthFault(end=common[0])
        else:
            faults[i] = LengthFault(row=i)
    return faults
