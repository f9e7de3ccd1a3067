"""A result with everything that a result can have, and can lack."""

from __future__ import annotations

import numpy as np

from uavgram.model.camera import Calibration
from uavgram.model.message import Message
from uavgram.model.provenance import InputDigest, Provenance
from uavgram.model.result.reliability import ErrorBudget, Noise, PickNoise, Reason, Verdict
from uavgram.model.result.result import (
    Alternative,
    AreaPlane,
    Estimate,
    GroupFactor,
    Result,
    SharedResult,
    SolutionSummary,
)
from uavgram.model.result.tables import (
    FrameResults,
    LineChecks,
    LineResults,
    MeasurementResults,
    PickResults,
    PlanarUncertainty,
    PointChecks,
    PointResults,
    PoseTable,
    TieSummary,
)
from uavgram.model.survey import Geodetic, World


def _poses(rng: np.random.Generator, absent: list[int]) -> PoseTable:
    tables = [rng.normal(size=(4, *shape)) for shape in ((3,), (3, 3), (6, 6))]
    for table in tables:
        table[absent] = np.nan
    return PoseTable(center_world_m=tables[0], world_from_camera=tables[1], covariance=tables[2])


def _estimate(rng: np.random.Generator, n: int) -> Estimate:
    return Estimate(value=rng.normal(size=n), sigma=rng.uniform(size=n))


def _points(rng: np.random.Generator) -> PointResults:
    root = rng.normal(size=(3, 2, 2)) * 0.1
    solid = np.random.default_rng(3).normal(size=(3, 3, 3)) * 0.1
    return PointResults(
        label=("P", "Q;ü", "R"),
        position_world_m=rng.normal(size=(3, 3)) * 20,
        covariance_m2=root @ root.transpose(0, 2, 1),
        ellipse_95_m=np.array([[0.2, 0.1], [0.3, 0.3], [5.0, 1.0]]),
        ellipse_azimuth_rad=np.array(
            [
                0.3852781571486482,
                1.2345678901234567,
                3.1,
            ]
        ),  # [0]: degrees would lose a bit
        relative=PlanarUncertainty(
            covariance_m2=root.transpose(0, 2, 1) @ root,
            ellipse_95_m=np.array([[0.02, 0.01], [0.03, 0.03], [0.5, 0.1]]),
            ellipse_azimuth_rad=np.array([0.1, 2.2, 3.05]),
            covariance_m3=np.where(
                np.array([False, True, False])[:, None, None],
                solid.transpose(0, 2, 1) @ solid,
                np.nan,
            ),
        ),
        departure_m=np.array([0.031, -0.0125, 0.0]),
        departure_sigma_m=np.array([0.01, 0.02, 0.0]),
        height_above_ground_m=np.array([0.0, 1.4, 0.0]),
        height_sigma_m=np.array([0.0, 0.021, 0.0]),
        covariance_m3=solid @ solid.transpose(0, 2, 1),
        height_source=("ground", "found", "ground"),
        latitude_deg=np.array([50.1, 50.1002, 50.1001]),
        longitude_deg=np.array([-104.6, -104.6003, -104.5999]),
        frames=(("a.jpg", "b.jpg"), ("a.jpg",), ()),
        neighbour_sigma_m=np.array([0.004, 0.0315, np.nan]),
        neighbours=(("Q;ü", "R"), ("R", "P"), ()),
    )


def _measurements(rng: np.random.Generator) -> MeasurementResults:
    three = ("P", "Q;ü", "R")
    return MeasurementResults(
        name=("m, long", "n", "o", "p east", "q", "r"),
        kind=("distance", "area", "line_distance", "coordinate", "skid_speed", "angle"),
        points=(("P", "R"), three, three, ("P",), ("P", "Z"), three),
        value=np.array([20.125, 3.5, 0.1, -7.0, np.nan, 33.0]),
        sigma=np.array([0.05, 0.1, 0.01, 0.2, np.nan, 1.0]),
        unit=("m", "m2", "m", "m", "m/s", "deg"),
        interval_95=np.array(
            [[20.0, 20.25], [3, 4], [0, 0.2], [-8, -6], [np.nan, np.nan], [31, 35]]
        ),
        correlation=np.where(np.arange(6) == 4, np.nan, rng.normal(size=(6, 6))),
        status=("ok", "not-checked", "doubtful", "contradicted", "not-checked", "ok"),
    )


def sample_result() -> Result:
    rng = np.random.default_rng(20)
    nan = np.nan
    return Result(
        name="crossing",
        verdict=Verdict(
            level="red",
            reasons=(
                Reason(cause="misfit", text="Picks and lengths contradict each other."),
                Reason(
                    cause="line-suspect",
                    text="The length 'n' does not fit.",
                    frames=("a.jpg",),
                    labels=("P", "R"),
                    lengths=("n",),
                    measurements=("m",),
                ),
            ),
        ),
        provenance=Provenance(
            program="uavgram",
            version="0.1.0",
            created_utc="2024-05-01T12:00:00Z",
            made_by="Ada Lovelace",
            inputs=(
                InputDigest(path="picks.csv", sha256="ab" * 32, size_bytes=17),
                InputDigest(path="camera.yaml", sha256="cd" * 32, size_bytes=0),
            ),
            options=(("mount.lever_arm_m", (0.0, 0.1, 0.2)), ("log", None), ("name", "x")),
            seed=None,
            packages=(("numpy", "2.4"), ("scipy", "1.17")),
        ),
        world=World(
            origin=Geodetic(50.1, -104.6, 577.25),
            height_datum="msl",
            gauge="world",
        ),
        camera=Calibration(
            name="c",
            model="fisheye",
            width_px=4000,
            height_px=3000,
            parameters=np.array([1000, 1001, 2000, 1500, 0.1, 1 / 3, 1e-17, -0.0]),
            covariance=np.cov(rng.normal(size=(8, 20))),
        ),
        shared=SharedResult(
            boresight_deg=_estimate(rng, 3),
            lever_arm_m=_estimate(rng, 3),
            position_bias_m=None,
            heading_bias_deg=_estimate(rng, 1),
            clock_offset_s=_estimate(rng, 1),
            clock_drift_ppm=_estimate(rng, 1),
            intrinsics=_estimate(rng, 8),
        ),
        areas=tuple(
            AreaPlane(
                name=name,
                height_m=_estimate(rng, 1),
                slope_deg=_estimate(rng, 2),
                pivot_m=rng.normal(size=2),
            )
            for name in ("default", "verge")
        ),
        frames=FrameResults(
            frame_id=("a.jpg", "b.jpg", "c.jpg", "d.jpg"),
            path=("/x/a.jpg", "/x/b.jpg", "/x/c.jpg", "/x/d.jpg"),
            time_utc_s=np.array([1714564800.123456, nan, 1714564801.0, nan]),
            status=("refined", "unmatched", "seeded", "rejected"),
            reason=("", "no time", "no pick", "below the ground"),
            seed=_poses(rng, [1, 3]),
            refined=_poses(rng, [1, 2, 3]),
            ties=np.array([131, 0, 0, 0]),
            ties_rms_px=np.array([0.21, nan, nan, nan]),
        ),
        points=_points(rng),
        lines=LineResults(
            name=("n", "m", "o"),
            start=("P", "P", "P"),
            end=("R", "Z", "Q;ü"),
            length_m=np.array([20.0, 3.0, 4.0]),
            sigma_m=np.array([0.01, 0.02, 0.03]),
            adjusted_m=np.array([20.001, nan, 4.1]),
            adjusted_sigma_m=np.array([0.009, nan, 0.02]),
            residual_m=np.array([0.001, nan, 0.1]),
            w=np.array([0.2, nan, 3.0]),
            redundancy=np.array([0.3, nan, nan]),
            mdb_m=np.array([0.05, nan, nan]),
            status=("used", "unseen", "checked"),
        ),
        picks=PickResults(
            image=("a.jpg", "b.jpg", "a.jpg"),
            label=("P", "P", "R"),
            pixel_px=rng.uniform(0, 1000, (3, 2)),
            sigma_px=np.array([1.0, 2.0, 1.5]),
            residual_px=np.array([[0.5, -0.25], [nan, nan], [4.0, 1.0]]),
            w=np.array([0.7, nan, 4.4]),
            redundancy=np.array([0.5, nan, 0.25]),
            status=("used", "unused", "removed"),
            source=("hand", "match", "target"),
            score=np.array([nan, 0.93, 0.99]),
        ),
        measurements=_measurements(rng),
        error_budget=ErrorBudget(
            source=("picks", "flight log"),
            share=np.where(np.arange(6)[:, None] == 4, nan, [0.25, 0.75]),
        ),
        point_checks=PointChecks(
            label=("Q;ü",),
            error_m=np.array([[0.1, 0.2, 0.3]]),
            sigma_m=np.array([[0.3, 0.3, 0.4]]),
            mahalanobis=np.array([1.1]),
        ),
        line_checks=LineChecks(
            name=("o",), error_m=np.array([0.1]), sigma_m=np.array([0.05]), z=np.array([2.0])
        ),
        solution=SolutionSummary(
            degrees_of_freedom=0,
            variance_factor=nan,
            chi2_probability=nan,
            iterations=7,
            converged=True,
            alternatives=(
                Alternative(
                    frame_id="a.jpg", cost=1.5, height_m=40.0, tilt_deg=3.0, values=(20.1, nan)
                ),
            ),
            groups=(
                GroupFactor(
                    name="pixels",
                    observations=6,
                    redundancy=2.5,
                    variance_factor=0.9,
                    probability=0.6,
                ),
            ),
        ),
        noise=Noise(
            picks=tuple(
                PickNoise(source=source, stated_px=stated, factor=1.25, sigma=0.125)
                for source, stated in (
                    ("hand", 1.0),
                    ("target", 0.05),
                    ("match", 0.1),
                    ("tie", 0.2),
                )
            ),
            roughness=(),
        ),
        ties=TieSummary(points=131, sightings=131, rms_px=0.21),
        messages=(
            Message("warning", "label-unseen", "label 'Z' was never picked", labels=("Z",)),
            Message(
                "warning",
                "point-off-ground",
                "'B' fits 1.4 m above the ground",
                labels=("B",),
                heights_m=(1.4,),
                heights_sigma_m=(0.02,),
            ),
        ),
    )
