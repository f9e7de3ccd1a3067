"""Points with known coordinates, from the twins' truth: as observations and as judges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import pytest
from flight_projects import Truth, copy_project
from pyproj import Transformer

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

Kind = Literal["geodetic", "local"]


class Run(Protocol):
    """Of a twin, with some of its true points as control or check points."""

    def __call__(
        self, kind: Kind, role: str = ..., labels: Sequence[str] = ..., **changes: object
    ) -> Result: ...


SIGMA_M = 0.02
CONTROL = ("R1", "R3", "R6", "R8", "P5")
KINDS: dict[str, Kind] = {"calm_nadir": "geodetic", "wind_oblique": "local"}
"""Kind of the coordinates in each twin, where a test has one of them."""


def geodetic(enu: Floats, world: dict[str, Any]) -> Floats:
    """Latitude, longitude [deg], height [m] by way of geocentric coordinates (EPSG 4979, 4978)."""
    to_geocentric = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    longitude, latitude, height = (
        world[k] for k in ("longitude_deg", "latitude_deg", "height_amsl_m")
    )
    a, b = np.deg2rad(longitude), np.deg2rad(latitude)
    east = [-np.sin(a), np.cos(a), 0]
    north = [-np.sin(b) * np.cos(a), -np.sin(b) * np.sin(a), np.cos(b)]
    up = [np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)]
    origin = np.array(to_geocentric.transform(longitude, latitude, height))
    place = origin + np.asarray(enu) @ np.array([east, north, up])
    x, y, z = place.T
    lon, lat, h = to_geocentric.transform(x, y, z, direction="INVERSE")
    return np.column_stack([lat, lon, h])


def write_points(path: Path, kind: Kind, labels: Sequence[str], known: Truth) -> None:
    enu = np.array([known["points"][label] for label in labels])
    columns = "east_m,north_m,up_m"
    if kind == "geodetic":
        columns, enu = "latitude_deg,longitude_deg,height_m", geodetic(enu, known["world"])
    rows = [
        f"{n},{a!r},{b!r},{c!r},{SIGMA_M}"
        for n, (a, b, c) in zip(labels, enu.tolist(), strict=True)
    ]
    path.write_text("\n".join([f"label,{columns},sigma_m", *rows]) + "\n", encoding="utf-8")


def origin_of(known: Truth) -> dict[str, dict[str, float]]:
    """The truth's own origin: local coordinates are then the truth's."""
    world = known["world"]
    place = {key: world[key] for key in ("latitude_deg", "longitude_deg")}
    return {"origin": place | {"height_m": world["height_amsl_m"]}}


def assert_points_are_true(result: Result, known: Truth) -> None:
    """In the truth's own coordinates, within the joint covariance of east and north."""
    points = result.points
    true = np.array([known["points"][label] for label in points.label])
    if result.world.origin is not None:
        place = geodetic(true, known["world"])
        metre_deg = 1 / 111_132.0
        shrink = np.cos(np.deg2rad(known["world"]["latitude_deg"]))
        north = (points.latitude_deg - place[:, 0]) / metre_deg
        east = (points.longitude_deg - place[:, 1]) / metre_deg * shrink
        error = np.column_stack([east, north])
    else:
        error = (points.position_world_m - true)[:, :2]
    squared = np.einsum("ki,kij,kj->k", error, np.linalg.inv(points.covariance_m2), error)
    assert squared.max() <= 16
    # Control is good to 2 cm: nothing near it may be a metre off, as with a log alone.
    assert np.median(np.linalg.norm(error, axis=1)) < 0.1


@pytest.fixture(params=KINDS)
def twin(
    request: pytest.FixtureRequest, data_dir: Path, tmp_path: Path, truth: Callable[[str], Truth]
) -> tuple[Run, Truth]:
    name = request.param
    known = truth(name)

    def run(
        kind: Kind, role: str = "control", labels: Sequence[str] = CONTROL, **changes: object
    ) -> Result:
        write_points(tmp_path / f"{role}.csv", kind, labels, known)
        changes = {role: f"{role}.csv"} | changes
        project = copy_project(data_dir / name, tmp_path, **changes)
        return compute(read_inputs(project), curved=False).result

    return run, known


@pytest.fixture
def kind(request: pytest.FixtureRequest) -> Kind:
    name: str = request.node.callspec.params["twin"]
    return KINDS[name]


def test_geodetic_control_places_the_survey_on_the_earth(twin: tuple[Run, Truth]) -> None:
    run, known = twin
    result = run("geodetic")
    assert result.world.gauge == "world"
    assert_points_are_true(result, known)
    assert np.median(result.points.ellipse_95_m[:, 0]) < 0.2


def test_local_control_counts_from_the_origin_of_the_world(twin: tuple[Run, Truth]) -> None:
    run, known = twin
    result = run("local", world=origin_of(known))
    assert result.world.origin is not None
    assert result.world.origin.latitude_deg == pytest.approx(known["world"]["latitude_deg"])
    assert_points_are_true(result, known)
    local = dict(zip(result.points.label, result.points.position_world_m, strict=True))
    for label in CONTROL:
        np.testing.assert_allclose(local[label], known["points"][label], atol=4 * SIGMA_M)


def test_control_replaces_the_log(twin: tuple[Run, Truth], kind: Kind) -> None:
    run, known = twin
    result = run(kind, log=None, time=None)
    assert result.world.gauge == "world"
    assert (result.world.origin is None) == (kind == "local")
    assert result.shared.position_bias_m is None
    true = np.array([known["measurements"][name] for name in result.measurements.name])
    error = result.measurements.value - true
    seen = np.isfinite(error)
    assert seen.sum() > 60
    assert np.mean(np.abs(error / true)[seen]) < 0.003
    assert np.sqrt(np.mean((error / result.measurements.sigma)[seen] ** 2)) < 2.6


def test_check_points_only_judge(twin: tuple[Run, Truth], kind: Kind) -> None:
    run, known = twin
    plain = run(kind, role="check", labels=("R2", "P4"), world=origin_of(known), check=None)
    judged = run(kind, role="check", labels=("R2", "P4"), world=origin_of(known))
    np.testing.assert_array_equal(judged.measurements.value, plain.measurements.value)
    checks = judged.point_checks
    assert checks.label == ("R2", "P4")
    local = dict(zip(judged.points.label, judged.points.position_world_m, strict=True))
    for label, error in zip(checks.label, checks.error_m, strict=True):
        np.testing.assert_allclose(error, local[label] - known["points"][label], atol=2e-3)
    assert (np.abs(checks.error_m) < 4 * checks.sigma_m).all()
    assert (checks.mahalanobis < 5).all()


def test_one_control_point_without_a_log_fixes_nothing_and_is_told(twin: tuple[Run, Truth]) -> None:
    run, _ = twin
    result = run("local", labels=CONTROL[:1], log=None, time=None)
    assert result.world.gauge == "plane"
    assert any("control" in message.text for message in result.messages)


def test_a_control_point_that_nobody_picked_is_told(twin: tuple[Run, Truth]) -> None:
    run, known = twin
    known["points"]["R11"] = known["points"]["R1"]
    result = run("local", labels=(*CONTROL, "R11"), world=origin_of(known))
    assert any("'R11'" in message.text for message in result.messages)
