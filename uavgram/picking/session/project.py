"""The project that is open on the page: its session, its outputs, its calibration."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from anyio import to_thread

from uavgram.errors import UavgramError
from uavgram.io.photos.catalogue import UnusablePhotosError
from uavgram.picking.document import commands as c
from uavgram.picking.document.commands import RefusedError
from uavgram.picking.protocol import messages as m
from uavgram.picking.session.calibration_job import CalibrationJob
from uavgram.picking.session.outputs import Outputs
from uavgram.picking.session.session import PickSession
from uavgram.picking.session.workers import WatchedWork
from uavgram.picking.storage.journal import Changes, SetAside, find_oldest, list_changes
from uavgram.picking.storage.tables import FileWatch, Tables
from uavgram.pipeline.calibrate import use_camera
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.pick.live_survey import LiveSurvey
from uavgram.pipeline.setup import change_left_out, use_recorded_angles

log = logging.getLogger(__name__)

Run = Callable[[], object]
Keep = Callable[[Inputs], Tables]


class OpenProject:
    """Project that is open for picking.

    Parameters
    ----------
    survey, saver
        The project, and the store of its tables.
    run
        Runs the project from its files and writes its outputs.
    broadcast
        Called from any thread with messages for all pages.
    keep
        Makes a new store when the project is read again.
    """

    def __init__(
        self,
        survey: LiveSurvey,
        saver: Tables,
        run: Run,
        broadcast: m.Broadcast,
        keep: Keep,
    ) -> None:
        self.picking = PickSession(survey, saver, broadcast)
        self._path = Path(survey.inputs.project_path)
        self._run, self._broadcast, self._keep = run, broadcast, keep
        self._busy = asyncio.Lock()
        self._outside = FileWatch(survey.inputs)
        self.outputs = Outputs(Path(self.picking.output))
        self.calibration = CalibrationJob(self._path, broadcast)
        self._written_then = self._describe_outputs()
        self._aside = find_oldest(self.outputs.folder)
        self.refuses = ""
        self._writing = WatchedWork("results", broadcast)
        self._works: dict[c.Work, WatchedWork] = {**self.picking.works, "results": self._writing}

    def open(self) -> None:
        """Start the picking session."""
        self.picking.open()

    @property
    def is_busy(self) -> bool:
        """Return whether outputs are being written, or a camera calibrated."""
        return self.reads_tables or self.calibration.is_busy

    @property
    def reads_tables(self) -> bool:
        """Return whether a run or a reload uses the tables, so that none is written meanwhile."""
        return self._busy.locked()

    async def close(self, *, waits: bool) -> None:
        """Stop all work, save everything, and release the project.

        Parameters
        ----------
        waits
            Whether a current run is completed first.
        """
        self.calibration.stop()
        async with self._busy if waits else contextlib.nullcontext():
            self.refuses = self.refuses or "the project is being closed"
            await to_thread.run_sync(self._stop)
            self.picking.close()

    def _stop(self) -> None:
        """End own threads and processes, after the current adjustment."""
        self.calibration.close()
        self.outputs.close()
        self.picking.stop()

    def initial_state(self) -> m.InitialState:
        """Return everything that a page needs at its start."""
        return {
            **self.picking.initial_state(),
            "outputs": self._describe_outputs(),
            "outside": self._outside.find_changed_files(self.picking.saver.find_changed_tables()),
            "added": self._outside.added,
            "calibration": self.calibration.last_message,
            "stages": {kind: work.shown for kind, work in self._works.items()},
            "aside": None if self._aside is None else len(self._changes(self._aside)),
        }

    def look_outside(self) -> None:
        """Notify the pages if another program changed a file of the project."""
        if self.refuses:
            return
        outside = self._outside
        before = outside.last_changed, outside.added
        files = outside.find_changed_files(self.picking.saver.find_changed_tables())
        if (files, outside.added) != before:
            self._broadcast({"t": "outside", "files": files, "added": outside.added})
        if (written := self._describe_outputs()) != self._written_then:
            self._written_then = written
            self._broadcast({"t": "outputs", "outputs": written})

    async def do(self, action: c.ProjectAction) -> m.ActionAnswer:
        """Carry out an action on the project as a whole; the answer is for that page only.

        Raises
        ------
        UavgramError
            The action is impossible; the message gives the reason.
        """
        match action:
            case c.Refuse():
                self.picking.refuse(action)
            case c.Export():
                return await self._export()
            case c.Folders():
                return {
                    "t": "folders",
                    "folders": await to_thread.run_sync(self.calibration.folders),
                }
            case c.Calibrate():
                self.calibration.start(action)
            case c.StopWork():
                self._stop_work(action.work)
            case c.Reload() | c.UseCamera() | c.LeaveOut() | c.UseRecorded():
                await to_thread.run_sync(self._find_change(action))
                await self._reload()
            case c.TakeAside() | c.DiscardAside():
                is_taken = isinstance(action, c.TakeAside)
                return {"t": "done", "refused": await self._deal_with_aside(take=is_taken)}
        return {"t": "done"}

    def _stop_work(self, work: c.Work) -> None:
        if work == "calibration":
            self.calibration.stop()
        else:
            self._works[work].stop()

    async def _export(self) -> m.Exported:
        """Save and run the project; return its outputs, or the reason for none."""
        async with self._busy:  # one at a time, even if several pages ask
            self.picking.save()
            if self.picking.fault:
                return {"t": "exported", "why": self.picking.fault}
            version, damage = self.picking.version, None
            try:
                await to_thread.run_sync(self._writing.run, self._run)
            except UnusablePhotosError as why:  # lost or damaged while the page is open
                damage = why
        if damage is not None:
            await self._reload()  # as if it were opened now: the page offers to leave them out
            raise damage
        await to_thread.run_sync(self.outputs.look)
        self._written_then = self._describe_outputs()
        written: m.Outputs = {**self._written_then, "version": version}
        self._broadcast({"t": "outputs", "outputs": written})
        return {"t": "exported", "outputs": written}

    async def _deal_with_aside(self, *, take: bool) -> int:
        """Apply or discard the changes of an earlier session; return how many do not fit."""
        async with self._busy:
            if self._aside is None:
                raise RefusedError("nothing is set aside any more")
            aside, refused = self._aside, 0
            if take:
                refused = self.picking.take(self._changes(aside), step=time.time_ns() // 1_000_000)
                self.picking.save()
            aside.rename("taken" if take else "discarded")
            self._aside = find_oldest(self.outputs.folder)
        self._broadcast(self.initial_state())
        return refused

    def _changes(self, aside: SetAside) -> Changes:
        return list_changes(aside, self.picking.state, self.picking.index)

    def _describe_outputs(self) -> m.Outputs:
        """Return the outputs, with the number of the present state if they were made from it."""
        made_of = self.outputs.made_of
        is_current = made_of is not None and made_of == self.picking.inputs_now()
        return {
            "folder": str(self.outputs.folder),
            "files": self.outputs.list_files(),
            "recording": self.outputs.has_recording,
            "stamp": self.outputs.stamp,
            "version": self.picking.version if is_current else None,
        }

    def _find_change(
        self, action: c.Reload | c.UseCamera | c.LeaveOut | c.UseRecorded
    ) -> Callable[[], None]:
        """Return what an action changes in the project file before it is read again."""
        match action:
            case c.UseCamera():
                return self._use_camera()
            case c.LeaveOut():
                return self._leave_out(action)
            case c.UseRecorded():
                return partial(use_recorded_angles, self._path)
            case c.Reload():
                return lambda: None

    def _use_camera(self) -> Callable[[], None]:
        made, made_for = self.calibration.made, self.calibration.made_for
        if made is None or made_for is None:
            raise RefusedError("no camera file was made yet")
        photo = self.picking.photos[0]
        if (made_for["width_px"], made_for["height_px"]) != (photo.width_px, photo.height_px):
            raise RefusedError(
                f"the camera file is for {made_for['width_px']} x {made_for['height_px']} px, the "
                f"photos of the project have {photo.width_px} x {photo.height_px}: calibrate with "
                "photos of their size"
            )
        return partial(use_camera, self._path, made)

    def _leave_out(self, action: c.LeaveOut) -> Callable[[], None]:
        inputs, damage = self.picking.survey.inputs, self.picking.survey.damage
        there = {photo.path.name for photo in damage.photos} if damage else set[str]()
        there |= {photo.name for photo in self.picking.photos}
        known = inputs.project.leave_out if action.is_taken_back else there
        if unknown := [name for name in action.names if name not in known]:
            raise RefusedError(f"{unknown[0]!r} is no such photo: read the project again")
        back = action.is_taken_back
        return partial(change_left_out, self._path, action.names, is_taken_back=back)

    async def _reload(self) -> None:
        """Read the files again; changes that only the page has are saved beside them, or replayed.

        Raises
        ------
        UavgramError
            The project cannot be read as it is now: the page continues with the former one.
        """
        async with self._busy:
            self.refuses = "the project is being read again: wait a moment"
            try:
                self.picking.save()
                survey = await to_thread.run_sync(LiveSurvey.open, self._path)
                await to_thread.run_sync(self.picking.stop)
                self.picking.saver.close()
                self._begin(survey)
            except UavgramError:
                self.refuses = ""
                raise
            self.refuses = ""
        self._broadcast(self.initial_state())

    def _begin(self, survey: LiveSurvey) -> None:
        try:
            saver = self._keep(survey.inputs)
        except UavgramError as why:  # the files changed once more since
            self.refuses = f"{why}. Start uavgram again"
            log.warning("the project was let go: %s", why)
            return
        before = self.picking.session
        self.picking = PickSession(survey, saver, self._broadcast)
        self.picking.resume(before)
        self._outside = FileWatch(survey.inputs)
        if self.outputs.folder != Path(self.picking.output):
            self.outputs.close()
            self.outputs = Outputs(Path(self.picking.output))
        self._aside = find_oldest(self.outputs.folder)
        self.picking.open()
