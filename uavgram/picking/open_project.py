"""The project that is open on the page: its desk, its outputs, its bench, and errands about it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from pathlib import Path

from anyio import to_thread

from uavgram.errors import UavgramError
from uavgram.picking import commands as c
from uavgram.picking.answers import Json
from uavgram.picking.autosave import Saver
from uavgram.picking.bench import Bench
from uavgram.picking.desk import Desk
from uavgram.picking.messages import RefusedError
from uavgram.picking.outputs import Outputs
from uavgram.picking.outside import Outside
from uavgram.pipeline.calibrate_nearby import use_camera
from uavgram.pipeline.inputs import Inputs
from uavgram.pipeline.live import LiveSurvey

log = logging.getLogger(__name__)

Run = Callable[[], object]
Keep = Callable[[Inputs], Saver]


class OpenProject:
    """A project, open for picking.

    Parameters
    ----------
    survey, saver
        The project, and who keeps its tables.
    run
        Runs the project from its files and writes its outputs.
    tell
        Called with what every page should know, from any thread.
    keep
        Makes another saver, where the project is read again.
    """

    def __init__(
        self,
        survey: LiveSurvey,
        saver: Saver,
        run: Run,
        tell: Callable[[Json], None],
        keep: Keep,
    ) -> None:
        self.desk = Desk(survey, saver, tell)
        self._path = Path(survey.inputs.project_path)
        self._run, self._tell, self._keep = run, tell, keep
        self._busy = asyncio.Lock()
        self._outside = Outside(survey.inputs)
        self.outputs = Outputs(Path(self.desk.output))
        self.bench = Bench(self._path, tell)
        self.refuses = ""

    def open(self) -> None:
        """Begin."""
        self.desk.open()

    def stop(self) -> None:
        """End what runs in threads and processes of its own; waits for it."""
        self.bench.close()
        self.outputs.close()
        self.desk.stop()  # it waits for an adjustment under way

    def close(self) -> None:
        """Save everything, let go of the project."""
        self.desk.close()

    def hello(self) -> Json:
        """Everything a page needs to begin."""
        return {
            **self.desk.hello(),
            "outputs": self._written(),
            "outside": self._outside.changed(self.desk.changed_outside()),
            "calibration": self.bench.said or None,
        }

    def look_outside(self) -> None:
        """Tell the pages where another program changed a file of the project."""
        if self.refuses:
            return
        before = self._outside.said
        if (now := self._outside.changed(self.desk.changed_outside())) != before:
            self._tell({"t": "outside", "files": now})

    async def do(self, errand: c.Errand) -> Json:
        """Do an errand; the answer is for who asked.

        Raises
        ------
        UavgramError
            It cannot be done; says why.
        """
        match errand:
            case c.Export():
                return {"t": "exported", **await self._exported()}
            case c.Folders():
                return {"t": "folders", "folders": await to_thread.run_sync(self.bench.folders)}
            case c.Calibrate():
                self.bench.start(errand)
            case c.StopCalibration():
                self.bench.stop()
            case c.UseCamera():
                await self._use_camera()
            case c.Reload():
                await self._reload()
        return {"t": "done"}

    async def _exported(self) -> Json:
        """Save, run the project, and say which outputs there are; or why there are none."""
        async with self._busy:  # one at a time, whatever many pages ask for
            self.desk.save()
            if self.desk.fault:
                return {"why": self.desk.fault}
            version = self.desk.version
            await to_thread.run_sync(self._run)
        written = {**self._written(), "version": version}
        self._tell({"t": "outputs", "outputs": written})
        return {"outputs": written}

    def _written(self) -> Json:
        return {
            "folder": str(self.outputs.folder),
            "files": self.outputs.listed(),
            "recording": self.outputs.has_recording,
            "version": None,
        }

    async def _use_camera(self) -> None:
        made = self.bench.made
        if made is None:
            raise RefusedError("no camera file was made yet")
        said, photo = self.bench.said, self.desk.photos[0]
        if (said["width"], said["height"]) != (photo.width_px, photo.height_px):
            raise RefusedError(
                f"the camera file is for {said['width']} x {said['height']} px, the photos of the "
                f"project have {photo.width_px} x {photo.height_px}: calibrate with photos of "
                "their size"
            )
        await to_thread.run_sync(use_camera, self._path, made)
        await self._reload()

    async def _reload(self) -> None:
        """Take the files as they are now. What only the page has is kept beside them, or replayed.

        Raises
        ------
        UavgramError
            The project cannot be read as it is now: the page goes on with what it had.
        """
        async with self._busy:
            self.refuses = "the project is being read again: wait a moment"
            try:
                self.desk.save()
                survey = await to_thread.run_sync(LiveSurvey.open, self._path)
                await to_thread.run_sync(self.desk.stop)
                self.desk.let_go()
                self._begin(survey)
            except UavgramError:
                self.refuses = ""
                raise
            self.refuses = ""
        self._tell(self.hello())

    def _begin(self, survey: LiveSurvey) -> None:
        try:
            saver = self._keep(survey.inputs)
        except UavgramError as why:  # changed once more in this very moment
            self.refuses = f"{why}. Start `uavgram pick` again"
            log.warning("the project was let go: %s", why)
            return
        self.desk = Desk(survey, saver, self._tell)
        self._outside = Outside(survey.inputs)
        if self.outputs.folder != Path(self.desk.output):
            self.outputs.close()
            self.outputs = Outputs(Path(self.desk.output))
        self.desk.open()
