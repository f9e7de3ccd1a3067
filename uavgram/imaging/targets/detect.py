"""Detection of a board in many photos, several photos at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

from uavgram.imaging.raster import Image
from uavgram.imaging.targets.charuco import sight_charuco
from uavgram.imaging.targets.chessboard import sight_chessboard
from uavgram.imaging.targets.sighting import Sighting
from uavgram.model.camera.board import Board, BoardKind

Detector = Callable[[Image, Board], Sighting]

# A new kind of board is one more function here (and its name in BoardKind).
DETECTORS: dict[BoardKind, Detector] = {
    "chessboard": sight_chessboard,
    "charuco": sight_charuco,
}


def sight_board(image: Image, board: Board) -> Sighting:
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
        return sight_board(load(photo), board)

    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(sight, photos)
