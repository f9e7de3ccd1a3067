"""Coded plates are proposed without any pick, from photos that are looked through reduced."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from plate_pictures import photo_of, plate_samples, quad

from uavgram.imaging.photos.cache import GreyPhotos
from uavgram.imaging.raster import Image
from uavgram.imaging.targets.plates import read_cells
from uavgram.io.photos.catalogue import read_grey
from uavgram.model.observations import MeasurementRequest
from uavgram.picking.document.history import Session, apply
from uavgram.picking.document.proposals import BY_HAND, make_accept_command
from uavgram.picking.document.state import State
from uavgram.picking.session import searches as module
from uavgram.picking.session.proposal_table import ProposalTable
from uavgram.picking.session.searches import PlateSearch
from uavgram.pipeline.measure.inputs import read_inputs

SIZE_PX = 120
CORNERS = quad((60.0, 58.5), 40.0, 8.0)
CAMERA = f"""name: small
model: brown
width_px: {SIZE_PX}
height_px: {SIZE_PX}
parameters: [200, 200, 59.5, 59.5, 0, 0, 0, 0, 0]
sigma: [1, 1, 1, 1, 0.01, 0.01, 0.001, 0.001, 0.001]
"""
PROJECT = """images: "*.png"
camera: camera.yaml
picks: picks.csv
targets: {family: aruco-4x4-50, side_m: 0.5, sigma_m: 0.001}
"""
SHOWN, EMPTY, GONE = "c.png", "a.png", "b.png"
CORNER_PAIRS = {(SHOWN, f"T7-{k}") for k in (1, 2, 3, 4)}
NAMED = State(requests=(MeasurementRequest(name="d", kind="coordinate", points=("T7",)),))
LONGEST_WAIT_S = 20.0


class World:
    """A seeker on three photos: one shows a plate, one cannot be read any more.

    Attributes
    ----------
    whole
        Photos that were decoded as a whole.
    """

    def __init__(self, folder: Path) -> None:
        samples = plate_samples(read_cells("aruco-4x4-50", 7), CORNERS, (SIZE_PX, SIZE_PX))
        cv2.imwrite(str(folder / SHOWN), photo_of(samples, np.random.default_rng(0)))
        for name in (EMPTY, GONE):
            cv2.imwrite(str(folder / name), np.full((SIZE_PX, SIZE_PX), 90, np.uint8))
        (folder / "camera.yaml").write_text(CAMERA)
        (folder / "project.yaml").write_text(PROJECT)
        inputs = read_inputs(folder / "project.yaml", unfinished=True, unpicked=True)
        (folder / GONE).unlink()
        self.whole: list[str] = []
        self.proposed = ProposalTable(lambda *_: None)

        def decoded(name: str) -> Image:
            self.whole.append(name)
            return read_grey(folder / name)

        self.photos = GreyPhotos(dict.fromkeys((SHOWN, EMPTY, GONE), SIZE_PX**2), decoded)
        self.seeker = PlateSearch(
            inputs, self.photos, lambda name, by: read_grey(folder / name, by), self.proposed
        )

    def found(self) -> set[tuple[str, str]]:
        return {pair for pair, one in self.proposed.outcomes.items() if one.found is not None}


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    monkeypatch.setattr(module, "MAX_PX", SIZE_PX**2 / 4)
    one = World(tmp_path)
    one.seeker.start()
    yield one
    one.seeker.stop()
    one.photos.stop()


def until(holds: Callable[[], bool]) -> None:
    latest = time.monotonic() + LONGEST_WAIT_S
    while not holds():
        assert time.monotonic() < latest
        time.sleep(0.002)


def test_a_plate_is_found_in_the_reduced_photo_and_measured_in_the_whole_one(world: World) -> None:
    world.seeker.submit(State())
    until(lambda: world.found() == CORNER_PAIRS)

    outcomes = world.proposed.outcomes
    assert world.whole == [SHOWN]
    for k, corner in enumerate(CORNERS):
        found = outcomes[SHOWN, f"T7-{k + 1}"].found
        assert found is not None
        assert found.sigma_px is not None
        assert np.hypot(found.u_px - corner[0], found.v_px - corner[1]) < 5 * found.sigma_px < 0.5
    after = apply(
        Session(state=State()), make_accept_command(outcomes, State(), CORNER_PAIRS)
    ).state
    assert {pick.source for pick in after.picks} == {"target"}
    assert len(after.picks) == 4


def test_a_centre_is_proposed_while_something_names_it(world: World) -> None:
    world.seeker.submit(State())
    until(lambda: world.found() == CORNER_PAIRS)
    world.seeker.submit(NAMED)
    until(lambda: world.found() == {*CORNER_PAIRS, (SHOWN, "T7")})
    world.seeker.submit(State())
    until(lambda: world.found() == CORNER_PAIRS)

    assert world.whole == [SHOWN]  # each photo is looked at once


def test_what_was_refused_stays_so_until_that_is_taken_back(world: World) -> None:
    world.seeker.submit(State())
    until(lambda: world.found() == CORNER_PAIRS)
    one = SHOWN, "T7-1"
    world.proposed.refuse([one])
    world.seeker.submit(NAMED)
    until(lambda: (SHOWN, "T7") in world.found())

    assert world.proposed.outcomes[one].why == BY_HAND
    assert one not in world.found()
    world.proposed.reopen([one])
    world.seeker.submit(State())
    until(lambda: world.found() == CORNER_PAIRS)
