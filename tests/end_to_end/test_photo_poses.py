"""Surveys without a log: poses from the photos, against surveyed targets and the photos' content.

Narrabeen: a Mavic's still with its gimbal tags and four RTK targets, the camera looking 14 degrees
below the horizon, so its pitch is everything. Brighton Beach: three nadir photos without targets;
that they show one beach turned about is what the convention is proved with.
"""

import itertools
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
import pytest
import yaml
from flight_projects import Demo, Truth
from published_scenes import (
    NARRABEEN_ORIGIN,
    Targets,
    camera_file,
    narrabeen_targets,
    withheld,
    write_project,
    write_table,
)

import uavgram
from uavgram.cli import main
from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.io.photos.catalogue import read_photos
from uavgram.io.photos.pose_sources import read_photo_poses
from uavgram.model.arrays import Floats
from uavgram.model.frames import PhotoExposures, PhotoPoses
from uavgram.model.message import Message
from uavgram.model.options import MountOptions, TelemetryOptions, TimeOptions
from uavgram.model.result.result import Result
from uavgram.pipeline.check import check
from uavgram.stages.seed.photo_exposures import find_photo_home, place_photos


class Write(Protocol):
    def __call__(self, kind: str, adjust: Sequence[str] = ..., **changes: object) -> Path: ...


@dataclass(frozen=True, kw_only=True)
class Brighton:
    """Three nadir photos, and what their tags say."""

    folder: Path
    poses: PhotoPoses
    exposures: PhotoExposures
    messages: tuple[Message, ...]


@dataclass(frozen=True, kw_only=True)
class Twin:
    """A twin's result with its log, its seeds handed over, and what runs it with such a file."""

    run: Callable[[str, Path], Result]
    by_log: Result
    handed: Path
    truth: Truth


STILL = "snapshotNarrabeen.JPG"
FOCAL_PX = 3320.0  # of the still, which has the pixels of the video
PLACE = "-33.72990203,151.30057472,98.03,9.5,-16.6,0"  # as the still's tags have it


@pytest.fixture(scope="module")
def narrabeen(data_dir: Path) -> Targets:
    return narrabeen_targets(data_dir / "narrabeen_mavic")


@pytest.fixture
def project(narrabeen: Targets, tmp_path: Path) -> Write:
    """Write a project on the still (exif) or on the video frames (CSV) with some known lengths."""

    def write(kind: str, adjust: Sequence[str] = (), **changes: object) -> Path:
        still = kind == "still"
        names = [STILL] if still else [n for n in narrabeen.pixels if n != STILL]
        rows = [(n, t, *uv) for n in names for t, uv in narrabeen.pixels[n].items()]
        lines = [
            (
                a[-1] + b[-1],
                a,
                b,
                np.linalg.norm(narrabeen.world[a] - narrabeen.world[b]),
                0.03,
                "adjust" if a[-1] + b[-1] in adjust else "check",
            )
            for a, b in itertools.combinations(sorted(narrabeen.world), 2)
        ]
        header = "image,latitude_deg,longitude_deg,height_m,yaw_deg,pitch_deg,roll_deg"
        write_table(tmp_path / "poses.csv", header, [(name, PLACE) for name in names])
        images = narrabeen.folder / (STILL if still else "frames/*.jpg")
        content: dict[str, object] = {
            "images": str(images),
            "poses": "exif" if still else "poses.csv",
            "world": {"origin": dict(NARRABEEN_ORIGIN)},
            "ground": {"height_sigma_m": 0.2},
        }
        content = {key: v for key, v in (content | changes).items() if v is not None}
        return write_project(tmp_path, _camera(still=still), rows, lines, **content)

    return write


def _camera(*, still: bool) -> dict[str, object]:
    # as published with the video frames; the still has its pixels (see test_published_scenes.py)
    parameters = [3320, 3319, 1758, 1090, 0.01638, 0.02744, -0.01, 0, 0.00105]
    if still:
        parameters[2:4] = 1758 + (4000 - 3840) / 2, 1090 + (2250 - 2160) / 2
        return camera_file((4000, 2250), parameters, [15, 15, 15, 15, 2e-3, 2e-3, *[1e-3] * 3])
    return camera_file((3840, 2160), parameters, [10, 10, 10, 10, *[1e-3] * 5])


def _rays(pixels: Sequence[Sequence[float]]) -> Floats:
    """Unit rays of a camera without distortion."""
    uv = np.array(pixels, float)
    rays: Floats = np.column_stack([(uv - [1999.5, 1124.5]) / FOCAL_PX, np.ones(len(uv))])
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    return rays


def test_the_gimbal_convention_meets_the_surveyed_targets(
    project: Write, narrabeen: Targets
) -> None:
    result = uavgram.run(project("still"), output=None)
    center = result.frames.seed.center_world_m[0]
    rotation = result.frames.seed.world_from_camera[0]
    names = sorted(narrabeen.world)
    world = np.array([narrabeen.world[n] for n in names])
    seen = _rays([narrabeen.pixels[STILL][n] for n in names])
    to_target = (world - center) @ rotation
    to_target /= np.linalg.norm(to_target, axis=1)[:, None]
    off = np.degrees(np.arccos(np.sum(seen * to_target, axis=1)))

    # the gimbal is known to be 2.6 to 3.2 degrees off in pitch; a wrong convention is tens off
    assert (off > 1.0).all()
    assert (off < 4.5).all()
    # what is left once a turn about the camera's x (pitch) is taken away: image coordinates agree
    pitch = float(np.mean(_up_angle(to_target) - _up_angle(seen)))
    turn = cv2.Rodrigues(np.radians([-pitch, 0, 0]))[0]
    left = np.degrees(np.arccos(np.sum(seen * (to_target @ turn.T), axis=1)))
    assert left.max() < 2.0
    # and no other reading of the three numbers comes near
    for wrong in _wrong_conventions():
        direction = (world - center) @ wrong
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        assert np.degrees(np.arccos(np.sum(seen * direction, axis=1))).min() > 15


def _up_angle(rays: Floats) -> Floats:
    return np.degrees(np.arctan2(-rays[:, 1], rays[:, 2]))


def _wrong_conventions() -> Iterator[Floats]:
    """Pitch or yaw with the other sign, yaw from east, pitch from nadir, axes not swapped."""

    def looking(yaw: float, pitch: float) -> Floats:
        yaw, pitch = np.radians([yaw, pitch])
        z = np.array([np.cos(pitch) * np.sin(yaw), np.cos(pitch) * np.cos(yaw), np.sin(pitch)])
        x = np.array([np.cos(yaw), -np.sin(yaw), 0.0])
        return np.column_stack([x, np.cross(z, x), z])

    yield looking(9.5, 16.6)
    yield looking(-9.5, -16.6)
    yield looking(90 - 9.5, -16.6)
    yield looking(9.5, -90 + 16.6)


def test_the_default_sigmas_allow_the_gimbal_its_three_degrees(project: Write) -> None:
    result = uavgram.run(project("still", adjust=("12", "34")), output=None)
    seed, refined = result.frames.seed, result.frames.refined
    step = cv2.Rodrigues(seed.world_from_camera[0].T @ refined.world_from_camera[0])[0].ravel()
    move = np.concatenate([refined.center_world_m[0] - seed.center_world_m[0], step])

    assert 1.0 < np.degrees(step[0]) < 3.5  # the pitch goes up by what is known to be wrong
    assert (np.abs(move) / np.sqrt(np.diag(seed.covariance[0])) < 2).all()
    assert not [m for m in result.messages if m.code == "telemetry-strained"]
    assert result.solution.chi2_probability > 0.01


def test_photo_poses_have_no_clock_to_report(project: Write, tmp_path: Path) -> None:
    uavgram.run(project("still", adjust=("12", "34")), output=tmp_path / "out")

    clock = json.loads((tmp_path / "out" / "results.json").read_text())["clock"]
    assert set(clock.values()) == {None}


def test_the_seed_alone_is_far_off_and_says_so(project: Write) -> None:
    relative, in_sigmas = withheld(uavgram.run(project("still"), output=None))

    assert (relative < -0.15).all()  # 18 to 27 % short at this grazing view
    assert np.abs(in_sigmas).max() < 2


@pytest.fixture(scope="module")
def brighton(data_dir: Path) -> Brighton:
    folder = data_dir / "brighton_beach"
    photos, _ = read_photos((str(folder / "DJI_*.JPG"),), TimeOptions())
    poses, messages = read_photo_poses("exif", photos, "msl")
    origin, _ = find_photo_home(poses)
    exposures, _ = place_photos(poses, origin, MountOptions(), TelemetryOptions())
    return Brighton(folder=folder, poses=poses, exposures=exposures, messages=messages)


@pytest.mark.parametrize("other", [0, 1])
def test_nadir_photos_of_one_beach_lie_on_it_as_their_tags_say(
    brighton: Brighton, other: int
) -> None:
    # DJI_0033 is as the camera wrote it: the middle of the other photo lies in it where its yaw of
    # 42.9 degrees and the two places say. 40 m up a pixel is 18 mm; two times 3 m and 3 degrees.
    middle = np.array([[[1999.5, 1499.5]]])
    files = [brighton.folder / brighton.exposures.frame_id[k] for k in (other, 2)]
    found = _homography(*files)
    seen = cv2.perspectiveTransform(middle, found)[0, 0]
    expected = _ground_homography(brighton.exposures, other, 2)
    assert np.linalg.norm(seen - cv2.perspectiveTransform(middle, expected)[0, 0]) * 0.018 < 3
    assert np.linalg.norm(seen - middle[0, 0]) * 0.018 > 25  # so any other yaw is metres off
    # The other one Windows Photo Viewer has turned by 180 degrees and saved: pixels, not tags.
    turn = _turn_deg(found, middle) - _turn_deg(expected, middle) - 180
    assert abs((turn + 180) % 360 - 180) < 10  # two compasses, 3.6 degrees each (6.2 and 6.7 seen)


def test_photos_that_an_editor_has_saved_are_pointed_at(brighton: Brighton) -> None:
    texts = [m.text for m in brighton.messages if m.code == "photo-edited"]

    assert len(texts) == 1
    assert "Microsoft Windows Photo Viewer" in texts[0]
    assert " saved 2 photos (the first is DJI_0025.JPG)" in texts[0]


def _homography(first: Path, second: Path) -> Floats:
    """Pixels of one photo to the other's, from what both show."""
    images = [cv2.imread(str(p), cv2.IMREAD_REDUCED_GRAYSCALE_4) for p in (first, second)]
    sift = cv2.SIFT.create(4000)
    (a, da), (b, db) = (sift.detectAndCompute(image, None) for image in images if image is not None)
    pairs = [m for m, n in cv2.BFMatcher().knnMatch(da, db, k=2) if m.distance < 0.75 * n.distance]
    source = np.array([a[m.queryIdx].pt for m in pairs], np.float64) * 4
    target = np.array([b[m.trainIdx].pt for m in pairs], np.float64) * 4
    homography, inliers = cv2.findHomography(source, target, cv2.RANSAC, 15.0)
    assert inliers.sum() > 50
    return np.asarray(homography, np.float64)


def _ground_homography(exposures: PhotoExposures, first: int, second: int) -> Floats:
    """The same from the poses, for level ground at take-off and EXIF's 20 mm equivalent."""
    focal = 20 / 36 * 4000
    camera = np.array([[focal, 0, 1999.5], [0, focal, 1499.5], [0, 0, 1.0]])
    gimbal_from_camera = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0.0]])

    def pixel_from_ground(k: int) -> Floats:
        rotation = (exposures.world_from_gimbal[k] @ gimbal_from_camera).T
        columns = [rotation[:, 0], rotation[:, 1], -rotation @ exposures.position_world_m[k]]
        homography: Floats = camera @ np.column_stack(columns)
        return homography

    between: Floats = pixel_from_ground(second) @ np.linalg.inv(pixel_from_ground(first))
    return between


def _turn_deg(homography: Floats, at: Floats) -> float:
    """How a step to the right in the first photo lies in the second."""
    step = np.array([[[100.0, 0.0]]])
    ends = cv2.perspectiveTransform(np.concatenate([at, at + step]), homography)
    return float(np.degrees(np.arctan2(*(ends[1, 0] - ends[0, 0])[::-1])))


def test_altitudes_without_rtk_are_said_to_be_guesses(brighton: Brighton) -> None:
    assert "height-datum-assumed" in [m.code for m in brighton.messages]
    # the lake there lies at 183 m; the tags put take-off, on its shore, at 158.5 m
    np.testing.assert_allclose(
        brighton.poses.height_m - brighton.poses.height_home_m, 158.5, atol=0.02
    )


def test_photos_with_unused_poses_are_mentioned(project: Write) -> None:
    checked = check(project("still", poses=None, adjust=("12", "13", "34")))

    hint = [m.text for m in checked.messages if m.code == "poses-available"]
    assert len(hint) == 1
    assert "poses: exif" in hint[0]


def test_log_and_poses_together_are_refused_with_the_line(
    project: Write, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "flight.bin").write_bytes(b"")
    (tmp_path / "track.pos").write_text("% program : RTKPOST\n", encoding="utf-8")
    path = project("still", log="flight.bin")
    path.write_text(path.read_text().replace("poses: exif", "poses: track.pos"))

    assert main(["check", str(path)]) == 1
    error = capsys.readouterr().err
    assert "project.yaml:" in error
    assert "cannot be used together with `log`" in error


def test_heights_of_another_datum_are_refused_not_shifted(
    project: Write, capsys: pytest.CaptureFixture[str]
) -> None:
    path = project("still", world={"origin": dict(NARRABEEN_ORIGIN), "heights": "ellipsoid"})

    assert main(["check", str(path)]) == 1
    assert "set world.heights: msl" in capsys.readouterr().err


def test_without_an_origin_take_off_is_home(project: Write) -> None:
    result = uavgram.run(project("still", world=None), output=None)

    assert result.world.origin is not None
    assert result.world.origin.height_m == pytest.approx(98.03 - 100.40)
    assert [m for m in result.messages if m.code == "origin-first-photo"]


@pytest.mark.parametrize("poses", ["seed", "refined"])
def test_geotag_hands_over_what_its_own_reader_takes_back(
    project: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str], poses: str
) -> None:
    path = project("still", adjust=("12", "34"))
    folder = tmp_path / "handed"
    original = (path.parent / "camera.yaml").read_bytes()

    assert main(["geotag", str(path), "--output", str(folder), "--poses", poses, "--exif"]) == 0
    said = capsys.readouterr().out
    assert "above mean sea level" in said
    assert sorted(p.name for p in folder.iterdir()) == ["geo.txt", "pix4d.csv", "tagged"]
    result = uavgram.run(path, output=None)
    table = getattr(result.frames, poses)
    for source, image in (("exif", folder / "tagged" / STILL), (str(folder / "geo.txt"), None)):
        again = project("still", adjust=("12", "34"), poses=source)
        if image is not None:
            again = project("still", adjust=("12", "34"), images=str(image))
        seed = uavgram.run(again, output=None).frames.seed
        np.testing.assert_allclose(seed.center_world_m, table.center_world_m, atol=2e-3)
        step = cv2.Rodrigues(seed.world_from_camera[0].T @ table.world_from_camera[0])[0]
        assert np.linalg.norm(np.degrees(step)) < 1e-3
    assert (path.parent / "camera.yaml").read_bytes() == original


def test_geotag_never_writes_over_the_photos(
    project: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str], narrabeen: Targets
) -> None:
    folder = tmp_path / "tagged"
    folder.mkdir()
    copy = folder / STILL
    copy.write_bytes((narrabeen.folder / STILL).read_bytes())
    before = copy.read_bytes()
    path = project("still", images=str(copy))

    assert main(["geotag", str(path), "--output", str(tmp_path), "--exif"]) == 1
    assert "never written to" in capsys.readouterr().err
    assert copy.read_bytes() == before


def test_geotag_works_on_a_flight_with_a_log_too(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project = data_dir / "calm_nadir" / "project.yaml"

    assert main(["geotag", str(project), "--output", str(tmp_path), "--poses", "seed"]) == 0
    rows = (tmp_path / "geo.txt").read_text().splitlines()[3:]
    truth = json.loads((data_dir / "truth" / "calm_nadir.json").read_text())
    assert len(rows) == len(truth["frames"])
    pitch = np.array([float(row.split()[5]) for row in rows])
    assert np.abs(pitch).max() < 10  # nadir is 0 here
    assert capsys.readouterr().err == ""


@pytest.fixture(scope="module")
def twin(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Twin:
    """A twin's flight with its log, and its seeds handed over as geo.txt."""
    folder = data_dir / "calm_nadir"
    handed = tmp_path_factory.mktemp("twin")
    assert (
        main(["geotag", str(folder / "project.yaml"), "--output", str(handed), "--poses", "seed"])
        == 0
    )
    by_log = uavgram.run(folder / "project.yaml", output=None)

    def run(name: str, poses: Path) -> Result:
        content = yaml.safe_load((folder / "project.yaml").read_text())
        content = {k: str(folder / v) if k in FILES else v for k, v in content.items()}
        world = by_log.world
        assert world.origin is not None
        content["world"] = {"origin": world.origin._asdict()}
        del content["log"]
        path = handed / f"{name}.yaml"
        path.write_text(yaml.safe_dump(content | {"poses": str(poses)}))
        return uavgram.run(path, output=None)

    truth = json.loads((data_dir / "truth" / "calm_nadir.json").read_text())
    return Twin(run=run, by_log=by_log, handed=handed, truth=truth)


FILES = ("images", "camera", "picks", "lines", "measure", "log")


def _mean_error(twin: Twin, result: Result) -> float:
    rows = result.measurements
    truth = twin.truth["measurements"]
    known = [k for k, name in enumerate(rows.name) if name in truth and rows.kind[k] == "distance"]
    return float(np.mean([abs(rows.value[k] / truth[rows.name[k]] - 1) for k in known]))


def test_a_geo_txt_seeds_and_measures_as_the_log_does(twin: Twin) -> None:
    result = twin.run("geo", twin.handed / "geo.txt")
    seed, expected = result.frames.seed, twin.by_log.frames.seed

    np.testing.assert_allclose(seed.center_world_m, expected.center_world_m, atol=2e-3)
    np.testing.assert_allclose(seed.world_from_camera, expected.world_from_camera, atol=1e-5)
    assert len(result.measurements.name) == len(twin.by_log.measurements.name)
    assert _mean_error(twin, result) < 0.003
    # what was handed over is the camera's place: the lever arm is in it already
    assert "lever-arm-unused" in [m.code for m in result.messages]


def test_places_alone_measure_a_nadir_flight(twin: Twin) -> None:
    lines = (twin.handed / "geo.txt").read_text().splitlines()
    path = twin.handed / "places.txt"
    path.write_text("\n".join([lines[0], *(" ".join(x.split()[:4]) for x in lines[3:])]))
    result = twin.run("places", path)

    assert [m for m in result.messages if m.code == "attitude-unknown"]
    assert result.solution.converged
    assert _mean_error(twin, result) < 0.01


@pytest.mark.parametrize("step_s", [3, -3])
def test_photos_without_angles_may_be_flown_backwards(
    demo: Demo, tmp_path: Path, step_s: int
) -> None:
    """The demo's photos, in the order of their times or in the opposite one."""
    frames = {f"IMG_{k:04d}.jpg": f"20260101_12{30 + step_s * k:04d}.jpg" for k in range(1, 9)}
    home = tuple(demo.truth["world"][f"{key}"] for key in ("latitude_deg", "longitude_deg"))
    rng = np.random.default_rng(34)
    poses = ["image,latitude_deg,longitude_deg,height_m,sigma_horizontal_m,sigma_vertical_m"]
    for old, new in frames.items():
        shutil.copy(demo.folder / "photos" / old, tmp_path / new)
        center = np.array(demo.truth["frames"][old]["center_world_m"]) + rng.normal(0, 0.5, 3)
        degrees = geodetic_from_enu(center, (*home, 577.0))
        poses.append(f"{new},{degrees[0]:.9f},{degrees[1]:.9f},{degrees[2]:.3f},0.5,0.5")
    head, *rows = (demo.folder / "picks.csv").read_text(encoding="utf-8").splitlines()
    picks = [f"{frames[r.split(',')[0]]},{r.partition(',')[2]}" for r in rows if r[:12] in frames]
    (tmp_path / "picks.csv").write_text("\n".join([head, *picks]), encoding="utf-8")
    (tmp_path / "poses.csv").write_text("\n".join(poses), encoding="utf-8")
    project: dict[str, object] = {"images": "*.jpg", "poses": "poses.csv", "picks": "picks.csv"}
    for key, file in (
        ("camera", "camera.yaml"),
        ("lines", "lines.csv"),
        ("measure", "measure.csv"),
    ):
        project[key] = str(demo.folder / file)
    project["time"] = {"source": "filename", "filename_format": "%Y%m%d_%H%M%S"}
    origin = {"latitude_deg": home[0], "longitude_deg": home[1], "height_m": 577.0}
    project |= {"world": {"origin": origin}, "ground": {"height_sigma_m": 1.0}}
    (tmp_path / "project.yaml").write_text(yaml.safe_dump(project), encoding="utf-8")
    result = uavgram.run(tmp_path / "project.yaml", output=None)

    assert result.verdict.level == "green"
    assert [m.code for m in result.messages if m.level == "warning"] == ["attitude-unknown"]
