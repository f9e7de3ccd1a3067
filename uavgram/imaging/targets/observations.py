"""Board observations for a calibration from the sightings in many photos, with checks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from uavgram.errors import InputError
from uavgram.imaging.targets.sighting import Sighting
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera.board import Board, BoardObservations, BoardPhoto, LensSetting
from uavgram.model.message import Message, MessagePlural

LEAST_PHOTOS = 3
# Measured: 0.002 to 0.008 on rendered photos, 0.02 with a plain camera, 0.05 with a camera that
# sharpens its photos, so that white runs over into black.
LARGEST_MISFIT = 0.03
_CONTRADICTION = 6.0  # combined sigmas between the two operators
_SAME_PLACE_PX = 0.05  # median over a board: noise alone moves it more, even on a tripod


def collect_observations(
    board: Board,
    files: Sequence[str],
    size_px: tuple[int, int],
    settings: Sequence[LensSetting],
    sightings: Sequence[Sighting],
) -> tuple[BoardObservations, tuple[Message, ...]]:
    """Collect the corners of all photos.

    Parameters
    ----------
    board
        Board to find.
    files, settings, sightings
        (M,) names of the photos, their EXIF settings, and the corners found in them.
    size_px
        Width and height of the photos.

    Raises
    ------
    InputError
        No photo shows the board, the photos show a board of another size, two photos are the same,
        or too few are left.
    """
    _refuse_other_board(board, files, sightings)
    seen = [k for k, sighting in enumerate(sightings) if len(sighting.corner)]
    if len(seen) < LEAST_PHOTOS:
        raise InputError(
            files[seen[0]],
            f"only {len(seen)} of {len(files)} photos show the board ({_name(board)}): at least "
            f"{LEAST_PHOTOS} are needed, with the board tilted in different directions",
        )
    by_gradient = float(np.median([sightings[k].misfit for k in seen])) > LARGEST_MISFIT
    photos = [
        _photo(files[k], size_px, settings[k], sightings[k], by_gradient=by_gradient) for k in seen
    ]
    _refuse_same_places(photos, size_px)
    messages = [
        *_unseen_messages(files, sightings),
        *_partial_messages(board, photos, sightings, seen),
        *_operator_messages(by_gradient=by_gradient),
    ]
    return BoardObservations(board=board, photos=tuple(photos)), tuple(messages)


def _photo(
    file: str,
    size_px: tuple[int, int],
    setting: LensSetting,
    sighting: Sighting,
    *,
    by_gradient: bool,
) -> BoardPhoto:
    keep: Bools = np.ones(len(sighting.corner), np.bool_)
    pixel, sigma = sighting.pixel_px, sighting.sigma_px
    if by_gradient:
        apart = np.linalg.norm(sighting.pixel_px - sighting.gradient_px, axis=1)
        both = np.hypot(sighting.sigma_px, sighting.gradient_sigma_px)
        keep = apart <= _CONTRADICTION * both
        pixel, sigma = sighting.gradient_px, sighting.gradient_sigma_px
    return BoardPhoto(
        file=file,
        width_px=size_px[0],
        height_px=size_px[1],
        corner=sighting.corner[keep],
        pixel_px=pixel[keep],
        sigma_px=sigma[keep],
        setting=setting,
    )


def _refuse_other_board(board: Board, files: Sequence[str], sightings: Sequence[Sighting]) -> None:
    """Raise an error if the photos show another board, or one of another size in every photo."""
    others = [k for k, sighting in enumerate(sightings) if sighting.is_other_board]
    seen = [k for k, sighting in enumerate(sightings) if len(sighting.corner)]
    sizes = Counter(sightings[k].found_size for k in (others or seen))
    wanted = (max(board.columns, board.rows), min(board.columns, board.rows))
    if others and len(others) >= len(seen):
        raise _size_error(board, files[others[0]], sizes)
    if board.kind == "chessboard" and len(seen) >= LEAST_PHOTOS:
        size, count = sizes.most_common(1)[0]
        if size != wanted and count == len(seen):
            raise _size_error(board, files[seen[0]], sizes)
    if not seen:
        raise InputError(
            files[0],
            f"shows no board, nor does any of the {len(files)} photos: is --board right (asked "
            f"for: {_name(board)}), the whole board with its white rim in sight, and sharp?",
        )


def _size_error(board: Board, file: str, sizes: Counter[tuple[int, int] | None]) -> InputError:
    columns, rows = sizes.most_common(1)[0][0] or (0, 0)
    if board.kind == "charuco":
        there = f"{columns + 1} x {rows + 1} squares"
    else:
        there = f"{columns} x {rows} inner corners"
    return InputError(
        file,
        f"shows a board of {there}, it seems (and {sizes.total() - 1} other photos one like it), "
        f"not {_name(board)}: correct --board",
    )


def _name(board: Board) -> str:
    if board.kind == "charuco":
        return f"a ChArUco board of {board.columns + 1} x {board.rows + 1} squares"
    return f"a chessboard of {board.columns} x {board.rows} inner corners"


def _refuse_same_places(photos: Sequence[BoardPhoto], size_px: tuple[int, int]) -> None:
    """Raise an error if two photos show the board in one place: copies, or bursts from a tripod."""
    places = np.full((len(photos), max(int(p.corner.max()) for p in photos) + 1, 2), np.nan)
    for k, photo in enumerate(photos):
        places[k, photo.corner] = photo.pixel_px
    for k in range(1, len(photos)):
        apart = np.linalg.norm(places[:k] - places[k], axis=2)
        common = np.isfinite(apart).sum(axis=1)
        moved = np.array([_median(row) for row in apart])
        same = np.flatnonzero((moved < _SAME_PLACE_PX) & (2 * common >= len(photos[k].corner)))
        if len(same):
            raise InputError(
                photos[k].file,
                f"shows the board where {photos[int(same[0])].file} does, to "
                f"{_SAME_PLACE_PX:g} px of {size_px[0]}: one photo twice adds no information; "
                "leave one out",
            )


def _median(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("inf")


def _unseen_messages(files: Sequence[str], sightings: Sequence[Sighting]) -> list[Message]:
    messages = []
    without = [file for file, s in zip(files, sightings, strict=True) if s.found_size is None]
    if without:
        text = (
            f"{len(without)} of {len(files)} photos show no board, and are not used: "
            f"{', '.join(without)}."
        )
        messages.append(Message("warning", "photo-without-board", text, files=tuple(without)))
    for file, sighting in zip(files, sightings, strict=True):
        if sighting.is_other_board and sighting.found_size is not None:
            columns, rows = sighting.found_size
            text = (
                f"{file} seems to show a board of {columns} x {rows} inner corners, and is not "
                "used."
            )
            several = MessagePlural(
                "{count} photos seem to show another board, and are not used",
                f"{file} ({columns} x {rows} inner corners)",
            )
            messages.append(
                Message("warning", "photo-other-board", text, files=(file,), several=several)
            )
    return messages


def _partial_messages(
    board: Board, photos: Sequence[BoardPhoto], sightings: Sequence[Sighting], seen: Sequence[int]
) -> list[Message]:
    """List the photos that show a part of a chessboard, whose place on the board is unknown."""
    if board.kind != "chessboard":
        return []
    messages = []
    wanted = sorted((board.columns, board.rows))
    for photo, k in zip(photos, seen, strict=True):
        size = sightings[k].found_size
        if size is not None and sorted(size) != wanted:
            part = f"{size[0]} x {size[1]} of the {board.columns} x {board.rows} inner corners"
            text = (
                f"{photo.file} shows {part}; without markers their place on the board is unknown. "
                "That is right for a flat board; leave the photo out where a bow is estimated."
            )
            several = MessagePlural(
                "{count} photos show a part of the board, and without markers its place is unknown",
                f"{photo.file} ({size[0]} x {size[1]})",
                ending="That is right for a flat board; leave them out where a bow is estimated.",
            )
            messages.append(
                Message("info", "board-partial", text, files=(photo.file,), several=several)
            )
    return messages


def _operator_messages(*, by_gradient: bool) -> list[Message]:
    if not by_gradient:
        return []
    text = (
        "Corners were measured by grey value gradients: the photos are sharpened, smeared or "
        "overexposed, so that no simply blurred corner fits them. Expect a few tenths of a pixel; "
        "turn sharpening off, use more light, or hold the camera still for better ones."
    )
    return [Message("warning", "corners-misfit", text)]
