"""`uavgram rectify` through the command line, on the small simulated project."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import rasterio
import yaml
from pyproj import Transformer
from small_projects import Command, Project

from uavgram.imaging.top_view import brightness
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs

FILES = {"rectified.tif", "rectified.png", "rectified_sigma.tif"}


def frames_of(project: Project) -> list[str]:
    return sorted(path.name for path in (project / "photos").iterdir())


def test_the_mosaic_is_written_beside_the_results(project: Project, command: Command) -> None:
    done = command("rectify", project.path)

    assert done.status == 0, done
    folder = project.out / "rectified"
    assert {path.name for path in folder.iterdir()} == FILES
    for said in ("covered", "EPSG:", "sigma of a place", str(folder), *FILES):
        assert said in done.stdout
    with rasterio.open(folder / "rectified.tif") as file:
        assert file.crs.is_projected
        assert file.overviews(1)
        alpha = file.read(4)
        assert (file.read(1)[alpha == 255] == 90).all()  # the photos are of one grey
        coarse = file.transform.a * 16
    assert (alpha == 255).mean() > 0.3
    with rasterio.open(folder / "rectified_sigma.tif") as file:
        assert file.transform.a == pytest.approx(coarse)
        assert np.nanmin(file.read(1)) > 0
    assert cv2.imread(str(folder / "rectified.png")) is not None


def test_one_frame_at_a_size_of_ones_own(
    project: Project, command: Command, tmp_path: Path
) -> None:
    done = command(
        "rectify", project.path, "--frame", frames_of(project)[3], "--pixel-size", "0.5",
        "--output", tmp_path / "top",
    )  # fmt: skip

    assert done.status == 0, done
    assert "1 of the photos" in done.stdout
    with rasterio.open(tmp_path / "top" / "rectified.tif") as file:
        assert file.transform.a == 0.5
        assert file.tags()["frames"] == frames_of(project)[3]


def test_the_map_of_sigmas_agrees_with_the_adjustments_own(
    project: Project, command: Command
) -> None:
    # a point that only one frame sees is placed by that frame, and changes nothing else
    frame = frames_of(project)[3]
    pick = f"{frame},only here,{123.0},{211.0}"
    header, *rows = (project / "picks.csv").read_text(encoding="utf-8").splitlines()
    assert header.startswith("image,label,u_px,v_px")
    pick += "," * (header.count(",") - 3)
    (project / "picks.csv").write_text("\n".join([header, *rows, pick]) + "\n", encoding="utf-8")
    ground = yaml.safe_load(project.path.read_text(encoding="utf-8")).get("ground") or {}
    project.set(picks_sigma_px=0.7, ground=ground | {"roughness_sigma_m": 1.0})

    done = command("rectify", project.path, "--frame", frame, "--pixel-size", "0.2")

    assert done.status == 0, done
    computed = compute(read_inputs(project.path), curved=False)
    k = computed.result.points.label.index("only here")
    own = np.sqrt(np.linalg.eigvalsh(computed.result.points.covariance_m2[k])[1])
    place = computed.result.points
    with rasterio.open(project.out / "rectified" / "rectified_sigma.tif") as file:
        to_map = Transformer.from_crs("EPSG:4326", file.crs.to_string(), always_xy=True)
        east, north = to_map.transform(place.longitude_deg[k], place.latitude_deg[k])
        (read,) = next(file.sample([(east, north)]))
    assert read == pytest.approx(own, rel=2e-3)
    assert own > 0.05


def test_without_a_log_it_lies_in_local_metres(project: Project, command: Command) -> None:
    project.set(log=None, poses=None, check=None, control=None)
    frame = frames_of(project)[3]
    text = (project / "lines.csv").read_text(encoding="utf-8")
    (project / "lines.csv").write_text(text.replace(",check", ",adjust"), encoding="utf-8")

    done = command("rectify", project.path, "--frame", frame)

    assert done.status == 0, done
    assert "local metres" in done.stdout
    with rasterio.open(project.out / "rectified" / "rectified.tif") as file:
        assert file.crs is None
        assert file.tags()["gauge"] == "plane"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--frame", "nowhere.jpg"], "no frame 'nowhere.jpg'"),
        (["--pixel-size", "1e-7"], "ask for --pixel-size"),
        (["--pixel-size", "900"], "ask for --pixel-size"),
    ],
)
def test_what_cannot_be_done_is_one_message_with_the_way_out(
    project: Project, command: Command, arguments: list[str], said: str
) -> None:
    before = project.outputs()
    done = command("rectify", project.path, *arguments)

    assert done.status == 1
    assert said in done.stderr
    assert done.stderr.count("uavgram: ") == 1
    assert project.outputs() == before


@pytest.mark.parametrize("size", ["0", "-1", "wide"])
def test_a_size_that_is_none_is_wrong_usage(project: Project, command: Command, size: str) -> None:
    assert command("rectify", project.path, "--pixel-size", size).status == 2


def test_a_frame_without_a_pose_says_to_pick_in_it(project: Project, command: Command) -> None:
    frame = frames_of(project)[3]
    header, *rows = (project / "picks.csv").read_text(encoding="utf-8").splitlines()
    kept = [row for row in rows if not row.startswith(frame)]
    (project / "picks.csv").write_text("\n".join([header, *kept]) + "\n", encoding="utf-8")

    done = command("rectify", project.path, "--frame", frame)

    assert done.status == 1
    assert f"'{frame}' has no adjusted pose: pick points in it" in done.stderr


def test_a_photo_that_goes_while_it_is_needed_leaves_earlier_files(
    project: Project, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert command("rectify", project.path).status == 0
    before = project.outputs()
    taken = brightness.read_photo

    def gone(path: str, reduction: int) -> brightness.Photo:
        return taken(path + ".gone", reduction)

    monkeypatch.setattr(brightness, "read_photo", gone)
    done = command("rectify", project.path)

    assert done.status == 1
    assert "cannot be read" in done.stderr
    assert "Traceback" not in done.stderr
    assert project.outputs() == before


def test_a_folder_that_cannot_be_written_is_named(
    project: Project, command: Command, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way")

    done = command("rectify", project.path, "--output", tmp_path / "file" / "top")

    assert done.status == 1
    assert "choose another folder with --output" in done.stderr
