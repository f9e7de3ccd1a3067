"""All background searches in a project's photos during picking."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from uavgram.imaging.photos.cache import GreyPhotos
from uavgram.io.photos.catalogue import read_grey
from uavgram.picking.document.proposals import Outcome, Pair
from uavgram.picking.session.plate_search import PlateSearch
from uavgram.picking.session.point_search import PointSearch, SearchInput
from uavgram.picking.session.proposal_table import ProposalTable, Tell
from uavgram.pipeline.pick.live_survey import LiveSurvey


class Searches:
    """Search for picks in the other photos and for coded plates in all, on the same grey pixels.

    Parameters
    ----------
    survey
        The project.
    tell
        Called after each change, from any thread.
    """

    def __init__(self, survey: LiveSurvey, tell: Tell) -> None:
        photos = survey.inputs.photos
        paths = dict(zip(photos.frame_id, photos.path, strict=True))
        sizes = zip(photos.width_px.tolist(), photos.height_px.tolist(), strict=True)
        pixels = [round(width) * round(height) for width, height in sizes]
        self._grey = GreyPhotos(
            dict(zip(photos.frame_id, pixels, strict=True)), lambda name: read_grey(paths[name])
        )
        self._proposed = ProposalTable(tell)
        self._seeker = PointSearch(survey, self._grey, self._proposed)
        self._plates = PlateSearch(
            survey.inputs,
            self._grey,
            lambda name, factor: read_grey(paths[name], factor),
            self._proposed,
        )

    @property
    def outcomes(self) -> dict[Pair, Outcome]:
        """Copy of the present outcomes."""
        return self._proposed.outcomes

    def start(self) -> None:
        """Start the searches."""
        self._seeker.start()
        self._plates.start()

    def submit(self, wanted: SearchInput) -> None:
        """Search and propose for these picks."""
        self._seeker.submit(wanted)
        self._plates.submit(wanted.state)

    def refuse(self, pairs: Collection[Pair]) -> None:
        """Stop proposing, or asking for, some labels."""
        self._proposed.refuse(pairs)

    def reopen(self, pairs: Collection[Pair], wanted: SearchInput) -> None:
        """Search for refused labels again."""
        self._proposed.reopen(pairs)
        self.submit(wanted)

    def read_ahead(self, names: Sequence[str]) -> None:
        """Decode photos in this order, as many as memory allows."""
        self._grey.read_ahead(names)

    def stop(self) -> None:
        """End after the current photos."""
        self._seeker.stop()
        self._plates.stop()
        self._grey.stop()
