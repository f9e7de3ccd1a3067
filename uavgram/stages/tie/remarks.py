"""Remarks on tie points that were found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import coo_array

from uavgram.model.message import Message, MessagePlural
from uavgram.model.survey import TiePicks


def remarks(ties: TiePicks, photos: Sequence[str], file: str) -> Iterator[Message]:
    """Report the number of tie points, and photos without any.

    Parameters
    ----------
    ties
        Tie points as found.
    photos
        Names of all photos.
    file
        Name of the table that holds them.
    """
    if not ties.image:
        yield Message(
            "warning",
            "ties-none",
            "No two photos were found to show the same ground, so nothing ties them together. Are "
            "they of one place, and do they overlap? Check also that the camera file is theirs.",
        )
        return
    count = Counter(ties.image)
    numbers = sorted(count[name] for name in photos if name in count)
    yield Message(
        "info",
        "ties-found",
        f"{len(set(ties.tie))} tie points were found in {len(count)} of {len(photos)} photos, "
        f"{numbers[0]} to {numbers[-1]} in each: {file}.",
        files=(file,),
    )
    for name in photos:
        if name not in count:
            yield _untied(name)
    yield from _apart(ties, [name for name in photos if name in count])


def _untied(photo: str) -> Message:
    return Message(
        "info",
        "photo-untied",
        f"Nothing in the photo {photo!r} was found in another one, so no tie point helps to place "
        "it: it may be blurred, or show another place.",
        frames=(photo,),
        several=MessagePlural(
            "Nothing in {count} photos was found in others, so no tie point helps to place them",
            repr(photo),
            ending="They may be blurred, or show another place.",
        ),
    )


def _apart(ties: TiePicks, photos: Sequence[str]) -> Iterator[Message]:
    """Report groups of photos without common tie points."""
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415 - slow to load

    at = {name: k for k, name in enumerate(photos)}
    photo = np.array([at[name] for name in ties.image])
    point = np.unique(np.array(ties.tie), return_inverse=True)[1] + len(at)
    size = (int(point.max()) + 1,) * 2
    graph = coo_array((np.ones(len(photo), np.int8), (photo, point)), shape=size)
    _, group = connected_components(graph, directed=False)
    groups = Counter(group[: len(at)].tolist())
    if len(groups) == 1:
        return
    largest, most = groups.most_common(1)[0]
    others = tuple(name for name, k in zip(photos, group[: len(at)], strict=True) if k != largest)
    yield Message(
        "info",
        "ties-apart",
        f"The photos fall into {len(groups)} groups, and no tie point joins one with another: "
        f"{most} photos are joined; only poses and picks join {len(others)} others, such as "
        f"{others[0]!r}, with them. Pick points that both groups show.",
        frames=others,
    )
