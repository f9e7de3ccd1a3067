"""Calibration boards in photos: detection, ChArUco boards, checked observations, and a drawing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import cv2
import numpy as np

from uavgram.errors import InputError
from uavgram.imaging.photos.decoding import make_reduced_copies, scale_to_original
from uavgram.imaging.photos.preview import JPEG_QUALITY, Preview, decode_preview
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.chessboard import detect_chessboard
from uavgram.imaging.targets.corners import Sighting, measure_corners
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.board import Board, BoardKind, BoardObservations, BoardPhoto, LensSetting
from uavgram.model.message import Message, MessagePlural

WIDTHS_PX = (1200, 2400, 4800)
LEAST_CORNERS = 6
_LARGEST_BOARD = 20  # squares each way, in the search for another size
_CLEAR = 0.9  # of the distance from a corner to the nearest marker


def detect_charuco(image: Image, board: Board) -> Sighting:
    """Find a ChArUco board, or a part of it, in a photo.

    Parameters
    ----------
    image
        (height, width) grey, original size.
    board
        Board to find.
    """
    detector = cv2.aruco.CharucoDetector(charuco_board(board, (board.columns + 1, board.rows + 1)))
    grid = np.full((board.rows * board.columns, 2), np.nan)
    marker_px, marker = np.empty((0, 2)), np.empty(0, np.int64)
    for scale, small in make_reduced_copies(image, WIDTHS_PX):
        found, corner, quads, ids = detector.detectBoard(small)
        if ids is not None and len(ids) > len(marker):
            marker = np.asarray(ids, np.int64).ravel()
            centers = np.asarray(quads, np.float64).reshape(-1, 4, 2).mean(axis=1)
            marker_px = scale_to_original(centers, scale)
        if corner is not None and len(corner) > np.isfinite(grid[:, 0]).sum():
            grid[:] = np.nan
            pixel = np.asarray(found, np.float64).reshape(-1, 2)
            grid[np.asarray(corner).ravel()] = scale_to_original(pixel, scale)
        if np.isfinite(grid).all():
            break
    other = _other_size(board, marker, marker_px)
    if other is not None:
        return Sighting(found_size=other, is_other_board=True)
    if np.isfinite(grid[:, 0]).sum() < LEAST_CORNERS:
        return Sighting()
    # the nearest point of a marker is on the diagonal of a white square
    clear = _CLEAR * np.sqrt(0.5) * (1.0 - board.marker_m / board.square_m)
    shape = (board.rows, board.columns, 2)
    return measure_corners(image, grid.reshape(shape), clear, (board.columns, board.rows))


def charuco_board(board: Board, squares: tuple[int, int]) -> cv2.aruco.CharucoBoard:
    """Create OpenCV's object of a board with the given number of squares along x and y."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, board.dictionary))
    return cv2.aruco.CharucoBoard(squares, board.square_m, board.marker_m, dictionary)


def _other_size(board: Board, marker: Ints, marker_px: Floats) -> tuple[int, int] | None:
    """Find the inner corners of another board whose layout the markers show; None otherwise.

    Markers are numbered row by row, so their places in a photo determine the number in a row.
    """
    if len(marker) < LEAST_CORNERS:
        return None
    asked = _layout_error(board.columns + 1, marker, marker_px)
    is_too_large = int(marker.max()) >= (board.columns + 1) * (board.rows + 1) // 2
    if asked < 1.0 and not is_too_large:
        return None
    errors = {
        columns: _layout_error(columns, marker, marker_px)
        for columns in range(3, _LARGEST_BOARD + 1)
    }
    columns = min(errors, key=lambda key: errors[key])
    if errors[columns] > 0.5 * asked and not is_too_large:
        return None  # no other layout is clearly better
    rows = int(np.ceil(2 * (int(marker.max()) + 1) / columns))
    return columns - 1, max(rows - 1, 1)


def _layout_error(columns: int, marker: Ints, marker_px: Floats) -> float:
    """Compute the median error, in squares, of markers laid out in rows of `columns` squares.

    inf where no layout fits.
    """
    row, place = _marker_cells(columns, int(marker.max()) + 1)
    cell = np.stack([place, row], axis=1)[marker].astype(np.float64)
    if np.ptp(cell, axis=0).min() < 1:
        return float("inf")
    matrix = np.asarray(cv2.findHomography(marker_px, cell, cv2.RANSAC, 0.5)[0], np.float64)
    if matrix.shape != (3, 3):  # OpenCV returns None on failure
        return float("inf")
    mapped = cv2.perspectiveTransform(marker_px[:, None], matrix)[:, 0]
    return float(np.median(np.linalg.norm(mapped - cell, axis=1)))


def _marker_cells(columns: int, count: int) -> tuple[Ints, Ints]:
    """Compute row and column of the squares with markers 0 to count - 1, the white ones in turn."""
    row, column = np.divmod(np.arange(2 * count + 2 * columns), columns)
    white = (row + column) % 2 == 1
    return row[white][:count], column[white][:count]


def dictionary_size(name: str) -> int:
    """Return the number of markers of a dictionary; 0 for an unknown name."""
    if name not in dictionary_names():
        return 0
    return len(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)).bytesList)


def dictionary_names() -> tuple[str, ...]:
    """Return the names of OpenCV's dictionaries."""
    return tuple(name for name in dir(cv2.aruco) if name.startswith("DICT_"))


Detector = Callable[[Image, Board], Sighting]

# A new kind of board is one more function here (and its name in BoardKind).
DETECTORS: dict[BoardKind, Detector] = {
    "chessboard": detect_chessboard,
    "charuco": detect_charuco,
}


def detect_board(image: Image, board: Board) -> Sighting:
    """Find a board in one photo.

    Parameters
    ----------
    image
        (height, width) grey, original size and orientation.
    board
        Board to find.
    """
    return DETECTORS[board.kind](image, board)


def detect_in_photos(
    photos: Sequence[str],
    board: Board,
    load: Callable[[str], Image],
    workers: int | None = None,
) -> Iterator[Sighting]:
    """Find a board in photos, in their order.

    Parameters
    ----------
    photos
        Names that `load` understands.
    board
        Board to find.
    load
        Decodes one photo: (height, width) grey; it runs in the workers, so that no more photos than
        workers are in memory.
    workers
        Photos at a time; None: one for each processor. OpenCV releases Python's lock.
    """

    def sight(photo: str) -> Sighting:
        return detect_board(load(photo), board)

    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(sight, photos)


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
        *_report_missing_boards(files, sightings),
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


def _report_missing_boards(files: Sequence[str], sightings: Sequence[Sighting]) -> list[Message]:
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


_SHIFT = 4  # OpenCV draws to 1/16 px
_RADIUS_PX = 5
_LINE, _FIRST, _TEXT = (60, 200, 60), (60, 60, 240), (240, 160, 20)  # BGR
_ARROW = (220, 60, 220)


def draw_board(
    preview: Preview,
    board: Board,
    photo: BoardPhoto,
    residual_px: Floats | None = None,
    magnification: float = 1.0,
) -> bytes:
    """Draw the corners, their numbers and the rows of the board in a reduced photo; return a JPEG.

    Parameters
    ----------
    preview
        The photo, grey and reduced: each photo is decoded once.
    board, photo
        Board, and its corners in original pixels.
    residual_px
        (n, 2) of the corners, drawn as arrows.
    magnification
        Magnification of the arrows.
    """
    scale = np.array(preview.scale)
    grey = np.ascontiguousarray(decode_preview(preview)[:, :, 0])
    picture = np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), np.uint8)
    place = np.full((board.rows * board.columns, 2), np.nan)
    place[photo.corner] = (photo.pixel_px + 0.5) / scale - 0.5
    _draw_rows(picture, place.reshape(board.rows, board.columns, 2))
    found = place[photo.corner]
    for index, center in zip(photo.corner.tolist(), found, strict=True):
        color = _FIRST if index == 0 else _LINE
        cv2.circle(
            picture,
            _convert_to_fixed_point(center),
            _RADIUS_PX << _SHIFT,
            color,
            1,
            cv2.LINE_AA,
            _SHIFT,
        )
    _draw_numbers(picture, photo, found, board.columns)
    if residual_px is not None:
        ends = found + residual_px / scale * magnification
        for start, end in zip(found, ends, strict=True):
            cv2.line(
                picture,
                _convert_to_fixed_point(start),
                _convert_to_fixed_point(end),
                _ARROW,
                2,
                cv2.LINE_AA,
                _SHIFT,
            )
    quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    return bytes(cv2.imencode(".jpg", picture, quality)[1].tobytes())


def _draw_rows(picture: Image, grid: Floats) -> None:
    """Connect the known corners of each row."""
    for row in grid:
        known = row[np.isfinite(row[:, 0])]
        for start, end in pairwise(known):
            cv2.line(
                picture,
                _convert_to_fixed_point(start),
                _convert_to_fixed_point(end),
                _LINE,
                1,
                cv2.LINE_AA,
                _SHIFT,
            )


def _draw_numbers(picture: Image, photo: BoardPhoto, place: Floats, columns: int) -> None:
    """Write the numbers of the corners; only each row's first and last where space is short."""
    step = np.ptp(place, axis=0).max() / max(columns - 1, 1) if len(place) else 0.0
    for index, (u, v) in zip(photo.corner.tolist(), place.tolist(), strict=True):
        if step < 30 and index % columns not in (0, columns - 1):
            continue
        at = (round(u) + _RADIUS_PX, round(v) - _RADIUS_PX)
        cv2.putText(picture, str(index), at, cv2.FONT_HERSHEY_SIMPLEX, 0.4, _TEXT, 1, cv2.LINE_AA)


def _convert_to_fixed_point(point: Floats) -> tuple[int, int]:
    u, v = np.round(point * (1 << _SHIFT)).astype(int).tolist()
    return u, v
