"""``uavgram log FILE --plot``: a picture with something in it, and no state left behind."""

import io
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image
from scipy.spatial.transform import Rotation

from uavgram.imaging.photos.preview import Pixels
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.stages.log_summary import summarise_log
from uavgram.views import flight_log_plot as plot
from uavgram.views.flight_log_plot import log_plot_png

ORANGE, RED, BLUE = (217, 115, 13), (201, 42, 42), (47, 111, 181)


def drawn(path: Path) -> Pixels:
    summary = summarise_log(read_flight_log(path, positions_needed=False))
    return np.asarray(Image.open(io.BytesIO(log_plot_png(summary))).convert("RGB"))


def has(picture: Pixels, colour: tuple[int, int, int]) -> int:
    return int((np.abs(picture.astype(int) - colour).max(axis=2) < 8).sum())


def test_track_events_and_missed_shots_are_drawn(data_dir: Path) -> None:
    picture = drawn(data_dir / "wind_oblique" / "flight.BIN")
    row = picture.shape[0] // 4
    top_left, bottom_left = picture[:row, :715], picture[3 * row :, :715]
    assert has(top_left, BLUE) > 500
    assert has(top_left, ORANGE) > 500
    assert 20 < has(top_left, RED) < 400
    assert has(bottom_left, ORANGE) > 200


@pytest.mark.parametrize(
    ("name", "rows"),
    [("dronekit_flight.tlog", 3 + 3), ("sample.ulg", 1), ("pymavlink_test.BIN", 3)],
)
def test_every_boot_has_the_panels_that_it_has_something_for(
    data_dir: Path, name: str, rows: int
) -> None:
    assert drawn(data_dir / "logs" / name).shape[0] == round(110 * (0.8 + 3.6 * rows))


def panels_of(repository: Path, **changed: object) -> dict[str, Axes]:
    """Panels of a log of which some tables are others, by their titles."""
    summary = summarise_log(read_flight_log(repository / "logs" / "twin_short.BIN"))
    boot = replace(summary.boots[0], boot=replace(summary.boots[0].boot, **changed))  # type: ignore[arg-type]
    axes = {}
    for title, draw in plot._panels(boot):
        axes[title] = Figure().add_subplot()
        draw(axes[title])
    return axes


def test_attitude_and_quality_of_positions_are_drawn(repository: Path) -> None:
    boot = read_flight_log(repository / "logs" / "twin_short.BIN").boots[0]
    panels = panels_of(repository)
    assert boot.attitudes is not None
    assert boot.sigmas is not None

    roll, pitch = (
        np.asarray(line.get_ydata(), np.float64)
        for line in panels["Attitude of the vehicle"].get_lines()
    )
    turned = Rotation.from_quat(boot.attitudes.ned_from_body_xyzw).as_euler("ZYX", degrees=True)
    np.testing.assert_allclose(roll, turned[:, 2], atol=1e-6)
    np.testing.assert_allclose(pitch, turned[:, 1], atol=1e-6)
    horizontal, vertical = (
        np.asarray(line.get_ydata(), np.float64) for line in panels["GPS quality"].get_lines()
    )
    np.testing.assert_array_equal(horizontal, boot.sigmas.horizontal_m)
    np.testing.assert_array_equal(vertical, boot.sigmas.vertical_m)


@pytest.mark.parametrize(
    ("name", "satellites", "hdop"),
    [
        ("copter_3.4.4.bin", (15, 17), (0.6, 0.69)),
        ("dronekit_flight.tlog", (4, 8), (2.25, 5.54)),
        ("sample_log_small.ulg", (14, 15), (0.7, 0.75)),
        ("sample_px4_events.ulg", (10, 10), None),
    ],
)
def test_satellites_and_their_geometry_are_drawn_of_every_kind_of_log(
    data_dir: Path, name: str, satellites: tuple[int, int], hdop: tuple[float, float] | None
) -> None:
    summary = summarise_log(read_flight_log(data_dir / "logs" / name))
    axis = Figure().add_subplot()
    dict(plot._panels(summary.boots[0]))["GPS reception"](axis)

    curves = [
        np.asarray(line.get_ydata(), np.float64)
        for each in axis.figure.axes
        for line in each.get_lines()
    ]
    ranges = [(curve.min(), curve.max()) for curve in curves]
    np.testing.assert_allclose(ranges, [satellites] if hdop is None else [satellites, hdop])


def test_what_a_log_has_nothing_of_has_no_panel(repository: Path) -> None:
    every = set(panels_of(repository))
    assert set(panels_of(repository, events=None)) == every - {
        "Time from one camera event to the next"
    }
    assert set(panels_of(repository, attitudes=None, sigmas=None)) == every - {
        "Attitude of the vehicle",
        "GPS quality",
    }


def test_zeros_before_the_first_place_do_not_set_the_axis(repository: Path) -> None:
    boot = read_flight_log(repository / "logs" / "twin_short.BIN").boots[0]
    positions = boot.positions
    assert positions is not None
    early = np.arange(len(positions.height_m)) < 25
    height = np.where(early, 0.02, positions.height_m)
    axis = panels_of(repository, positions=replace(positions, height_m=height))["Height"]
    flown = positions.height_m[~early]

    low, high = axis.get_ylim()
    assert low < flown.min() < flown.max() < high
    assert low > 0.5 * flown.min()
    drawn_s = np.asarray(axis.get_lines()[0].get_xdata(), np.float64)
    np.testing.assert_array_equal(drawn_s, positions.time_boot_s[~early])


def test_no_window_toolkit_and_no_pyplot_is_loaded(repository: Path) -> None:
    before = "matplotlib.pyplot" in sys.modules
    drawn(repository / "logs" / "twin_short.BIN")
    assert ("matplotlib.pyplot" in sys.modules) == before
