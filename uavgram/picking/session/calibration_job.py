"""A camera calibration from photos of a board, running while picking continues.

The page names a folder by the number under which it was listed, never by its path. One calibration
runs at a time, in a thread of its own (OpenCV works outside Python's lock), into a new folder.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

from uavgram.config.board_text import parse_board
from uavgram.errors import UavgramError
from uavgram.io.folders import PhotoFolder
from uavgram.model.board import CalibrationOptions
from uavgram.picking.document.commands import Calibrate, RefusedError
from uavgram.picking.protocol import messages as m
from uavgram.pipeline.calibrate import (
    CAMERA,
    REPORT,
    CalibrationOutput,
    calibrate_folder,
    find_board_folders,
)
from uavgram.views.calibration.verdict import calibration_facts, judge_calibration

log = logging.getLogger(__name__)

Item = TypeVar("Item")

BROKEN_OFF = "it broke off (a fault of the program: its log says where)"


class CalibrationJob:
    """Background job that calibrates a camera.

    Parameters
    ----------
    project
        The project file.
    broadcast
        Called from any thread with messages for all pages.

    Attributes
    ----------
    last_message
        The last message to the pages; empty before the first calibration.
    made
        Camera file written by the last calibration; None if there is none.
    """

    def __init__(self, project: Path, broadcast: m.Broadcast) -> None:
        self._project = project
        self._broadcast = broadcast
        self._listed: dict[Path, int] = {}
        self._folders: dict[int, PhotoFolder] = {}
        self._thread: threading.Thread | None = None
        self._stopped = threading.Event()
        self.last_message: m.Calibration | None = None
        self.made: Path | None = None
        self.made_for: m.CalibrationResult | None = None

    @property
    def report(self) -> Path | None:
        """Path of the last calibration's report."""
        return None if self.made is None else self.made.with_name(REPORT)

    @property
    def is_busy(self) -> bool:
        """Return whether a calibration is running; false once its end was sent."""
        return self.last_message is not None and self.last_message["state"] == "running"

    def folders(self) -> list[m.Folder]:
        """Return the folders near the project that hold photos; each keeps its number."""
        found = find_board_folders(self._project)
        beside = self._project.absolute().parent
        for folder in found:
            self._folders[self._listed.setdefault(folder.path, len(self._listed))] = folder
        return [
            {
                "id": self._listed[folder.path],
                "name": _short(folder.path, beside),
                "photos": len(folder.files),
                "width_px": folder.size_px[0],
                "height_px": folder.size_px[1],
            }
            for folder in found
        ]

    def start(self, asked: Calibrate) -> None:
        """Begin a calibration; its progress and result are broadcast.

        Raises
        ------
        UavgramError
            A calibration is running already, or the folder or the board does not exist.
        """
        if self.is_busy:
            raise RefusedError("a calibration is running already")
        folder = self._folders.get(asked.folder)
        if folder is None:
            raise RefusedError(f"there is no folder {asked.folder}")
        parse_board(asked.board)
        self._stopped.clear()
        self._send_progress("reading the photos", 0, len(folder.files))
        self._thread = threading.Thread(
            target=self._work, args=(folder, asked), name="calibration", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop a running calibration; nothing of it is kept."""
        self._stopped.set()

    def close(self) -> None:
        """Stop and wait for the end."""
        self.stop()
        if self._thread is not None:
            self._thread.join()

    def _work(self, folder: PhotoFolder, asked: Calibrate) -> None:
        options = CalibrationOptions(model=asked.model)
        end: m.Calibration = _failed(BROKEN_OFF)  # unless it ends otherwise
        try:
            done = calibrate_folder(self._project, folder, asked.board, options, self._progress)
            result = _result(done, self._project.absolute().parent)
            end = {"t": "calibration", "state": "done", **result}
            self.made, self.made_for = done.folder / CAMERA, result
        except UavgramError as why:
            end = _failed(str(why))
        finally:
            self._send(end)  # last statement of the job: the next one may begin

    def _progress(self, items: Iterable[Item], what: str, total: int, /) -> Iterable[Item]:
        for k, item in enumerate(items):
            if self._stopped.is_set():
                raise RefusedError("stopped; nothing was written")
            self._send_progress(what, k + 1, total)
            yield item

    def _send_progress(self, what: str, done: int, total: int) -> None:
        self._send(
            {"t": "calibration", "state": "running", "what": what, "done": done, "total": total}
        )

    def _send(self, message: m.Calibration) -> None:
        self.last_message = message
        self._broadcast(message)


def _failed(why: str) -> m.CalibrationFailed:
    return {"t": "calibration", "state": "failed", "why": why}


def _result(done: CalibrationOutput, beside: Path) -> m.CalibrationResult:
    """Return the findings of a calibration in words."""
    camera = done.account.result.calibration
    verdict = judge_calibration(done.account)
    return {
        "verdict": verdict.sentence,
        "reasons": list(verdict.reasons),
        "counts": verdict.counts,
        "facts": list(calibration_facts(done.account)),
        "file": _short(done.folder / CAMERA, beside),
        "width_px": camera.width_px,
        "height_px": camera.height_px,
    }


def _short(path: Path, beside: Path) -> str:
    """Return a path relative to the project's folder."""
    if path == beside:
        return "the project's own folder"
    if path.is_relative_to(beside):
        return path.relative_to(beside).as_posix()
    return f"../{path.relative_to(beside.parent).as_posix()}"
