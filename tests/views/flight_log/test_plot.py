"""``uavgram log FILE --plot``: a picture with something in it, and no state left behind."""

import io
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from uavgram.imaging.photos.preview import Pixels
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.stages.log_summary import summarise_log
from uavgram.views.flight_log.plot import log_plot_png

ORANGE, RED, BLUE = (217, 115, 13), (201, 42, 42), (47, 111, 181)


def drawn(path: Path) -> Pixels:
    summary = summarise_log(read_flight_log(path, positions_needed=False))
    return np.asarray(Image.open(io.BytesIO(log_plot_png(summary))).convert("RGB"))


def has(picture: Pixels, colour: tuple[int, int, int]) -> int:
    return int((np.abs(picture.astype(int) - colour).max(axis=2) < 8).sum())


def test_track_events_and_missed_shots_are_drawn(data_dir: Path) -> None:
    picture = drawn(data_dir / "wind_oblique" / "flight.BIN")
    half = picture.shape[0] // 2
    top_left, bottom_right = picture[:half, :715], picture[half:, 715:]
    assert has(top_left, BLUE) > 500
    assert has(top_left, ORANGE) > 500
    assert 20 < has(top_left, RED) < 400
    assert has(bottom_right, ORANGE) > 200


@pytest.mark.parametrize(
    ("name", "boots"), [("dronekit_flight.tlog", 2), ("sample.ulg", 1), ("pymavlink_test.BIN", 1)]
)
def test_every_boot_has_its_panels(data_dir: Path, name: str, boots: int) -> None:
    assert drawn(data_dir / "logs" / name).shape[0] == round(110 * (0.8 + 7.2 * boots))


def test_no_window_toolkit_and_no_pyplot_is_loaded(repository: Path) -> None:
    before = "matplotlib.pyplot" in sys.modules
    drawn(repository / "logs" / "twin_short.BIN")
    assert ("matplotlib.pyplot" in sys.modules) == before
