"""Projects without a camera file: what the photos say of their camera, against surveyed targets."""

import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import yaml
from camera_facts import CameraFacts
from camera_photos import camera_photo
from pyproj import Transformer

import uavgram
from uavgram.errors import InputError
from uavgram.io.results.results_json import write_results
from uavgram.pipeline.check import check
from uavgram.views.report import render_annex

Write = Callable[[dict[str, object]], Path]


@dataclass(frozen=True)
class Narrabeen:
    """A project on the still, whose keys can be changed, and the folder of its photos."""

    folder: Path
    content: dict[str, object]
    save: Write

    def write(self, **changes: object) -> Path:
        return self.save(self.content | changes)


STILL = "snapshotNarrabeen.JPG"
FOCAL_PX = 3120.0  # of the still, from a resection on the targets


def _table(path: Path, header: str, rows: Sequence[Sequence[object]]) -> None:
    lines = [",".join(str(cell) for cell in row) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n")


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def _write(content: dict[str, object]) -> Path:
        path = tmp_path / "project.yaml"
        path.write_text(yaml.safe_dump(content))
        return path

    return _write


@pytest.fixture
def narrabeen(data_dir: Path, tmp_path: Path, write: Write) -> Narrabeen:
    """A project on the Mavic's still with its four RTK targets; `camera: auto`."""
    folder = data_dir / "narrabeen_mavic"
    control = json.loads((folder / "control.json").read_text())
    to_wgs84 = Transformer.from_crs("EPSG:28356", "EPSG:4326", always_xy=True)
    targets = [
        (p["id"], *to_wgs84.transform(*p["xyz"][:2])[::-1], p["xyz"][2], 0.2)
        for p in control["points"]
    ]
    _table(tmp_path / "control.csv", "label,latitude_deg,longitude_deg,height_m,sigma_m", targets)
    seen = next(p for p in control["photos"] if p["file"] == STILL)["observations"]
    rows = [(STILL, o["id"], *o["uv"]) for o in seen]
    _table(tmp_path / "picks.csv", "image,label,u_px,v_px", rows)
    origin = {"latitude_deg": -33.7299, "longitude_deg": 151.3006, "height_m": 2.475}
    content: dict[str, object] = {
        "images": str(folder / STILL),
        "camera": "auto",
        "picks": "picks.csv",
        "control": "control.csv",
        "poses": "exif",
        "world": {"origin": origin},
        "ground": {"height_sigma_m": 0.5},
    }
    return Narrabeen(folder=folder, content=content, save=write)


def test_the_assumed_camera_says_its_source_and_what_a_calibration_would_gain(
    narrabeen: Narrabeen,
) -> None:
    messages = {m.code: m for m in check(narrabeen.write()).messages}

    assert messages["camera-assumed"].level == "warning"
    assert "the table of drone cameras (DJI Mavic Pro" in messages["camera-assumed"].text
    assert re.search(r"2971 ± 238 px \(8\.0 %\)", messages["camera-assumed"].text)
    assert "with a calibration the focal length would be known" in messages["camera-assumed"].text


def test_a_survey_with_control_learns_the_focal_length_of_an_assumed_camera(
    narrabeen: Narrabeen, tmp_path: Path
) -> None:
    result = uavgram.run(narrabeen.write(), output=None)
    file = tmp_path / "results.json"
    write_results(result, file)
    record = json.loads(file.read_text())["shared"]["intrinsics"]
    message = next(m for m in result.messages if m.code == "camera-learnt")

    assert result.solution.converged
    # The still's focal length lies 5 % above the table's; the targets find it.
    assert record["prior_value"][0] == pytest.approx(2971.4, abs=0.1)
    assert record["prior_sigma"][0] == pytest.approx(237.7, abs=0.1)
    assert abs(record["value"][0] - FOCAL_PX) < 2 * record["sigma"][0]
    assert record["sigma_ratio"][0] < 0.6
    assert record["learnt"][:2] == [True, True]
    assert record["learnt"][4:] == [False] * 5
    np.testing.assert_allclose(
        record["shift_prior_sigmas"][0] * record["prior_sigma"][0],
        record["value"][0] - record["prior_value"][0],
    )
    assert message.text.startswith(
        "Picks and lengths show the camera better than the program assumed: the focal length "
    )
    assert "the lens distortion better" in message.text
    assert "<td>fx</td>" in render_annex(result)
    # What the program wrote is what it reads.
    again = uavgram.load_results(file)
    np.testing.assert_array_equal(again.shared.intrinsics.value, result.shared.intrinsics.value)


def test_video_frames_that_say_nothing_are_refused_with_the_way_out(
    narrabeen: Narrabeen, tmp_path: Path
) -> None:
    frame = "narrabeenFrames0001.jpg"
    _table(tmp_path / "picks.csv", "image,label,u_px,v_px", [(frame, "GCP1", 100, 100)])
    project = narrabeen.write(images=str(narrabeen.folder / "frames" / frame), poses=None)

    with pytest.raises(InputError, match=rf"{frame}: does not name its camera.*calibrate"):
        check(project)


def test_three_nadir_photos_share_one_assumed_camera(
    data_dir: Path, tmp_path: Path, write: Write
) -> None:
    beach = data_dir / "brighton_beach"
    _table(tmp_path / "picks.csv", "image,label,u_px,v_px", [("DJI_0025.JPG", "a", 2000, 1000)])
    images = str(beach / "*.JPG")
    content: dict[str, object] = {"images": images, "camera": "auto", "picks": "picks.csv"}
    done = check(write(content | {"poses": "exif"}))
    camera = done.inputs.calibration

    assert camera.name == "DJI FC300S"
    assert camera.parameters[0] == pytest.approx(3.61 / 6.3175 * 4000)


def test_no_point_is_placed_where_the_assumed_lens_folds_back(
    data_dir: Path, tmp_path: Path, write: Write
) -> None:
    """Photo at 40 m by its own tags, with one length that was read in feet.

    Beyond the fold of a lens known to 13 %, a point 66 m away has the same pixel.
    """
    _table(
        tmp_path / "picks.csv",
        "image,label,u_px,v_px",
        [("DJI_0025.JPG", "a", 1500, 650), ("DJI_0025.JPG", "b", 2500, 1450)],
    )
    _table(tmp_path / "lines.csv", "name,from,to,length_m,sigma_m", [("L1", "a", "b", 74.0, 0.01)])
    _table(tmp_path / "measure.csv", "name,kind,points", [("D1", "distance", "a;b")])
    project = write(
        {
            "images": str(data_dir / "brighton_beach" / "*.JPG"),
            "camera": "auto",
            "poses": "exif",
            "picks": "picks.csv",
            "lines": "lines.csv",
            "measure": "measure.csv",
        }
    )

    result = uavgram.run(project)

    by_height_m = math.hypot(1000, 800) / 2285.7 * 40.0
    assert result.measurements.value[0] == pytest.approx(by_height_m, rel=0.1)
    assert result.measurements.status[0] != "ok"
    assert any("in feet" in message.text for message in result.messages)


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"model": "FC300X"}, r"comes from another camera \(DJI FC300X\) than a\.jpg"),
        ({"focal": (94, 10)}, r"another focal length or zoom \(9\.4, not 4\.7\) than a\.jpg"),
        ({"dji": {"DewarpFlag": "1"}}, r"differs by its DewarpFlag .* from a\.jpg"),
        (
            {"make": "", "model": ""},
            "does not state its camera, as the others do: another program saved it again",
        ),
        ({"size": (300, 400)}, r"turned by 90 degrees \(300 x 400 px, the others 400 x 300\)"),
        ({"size": (200, 150)}, r"has another size \(200 x 150 px, the others 400 x 300\)"),
    ],
)
def test_photos_of_several_cameras_cannot_share_an_assumed_one(
    tmp_path: Path, write: Write, other: CameraFacts, words: str
) -> None:
    common: CameraFacts = {"make": "DJI", "model": "FC220", "focal": (47, 10)}
    camera_photo(tmp_path / "a.jpg", **common)
    camera_photo(tmp_path / "b.jpg", **(common | other))
    _table(tmp_path / "picks.csv", "image,label,u_px,v_px", [("a.jpg", "p", 20, 10)])

    with pytest.raises(InputError, match=rf"b\.jpg: .*{words}"):
        check(write({"images": "*.jpg", "camera": "auto", "picks": "picks.csv"}))


@pytest.mark.parametrize(
    ("size", "words"),
    [
        ((400, 300), r"uavgram camera .*camera\.yaml --size 400x300 --output camera_400x300\.yaml"),
        ((400, 200), r"photos differ\): give the camera file of this camera and resolution"),
    ],
)
def test_photos_of_another_size_than_the_camera_file_name_the_way_out(
    tmp_path: Path, write: Write, size: tuple[int, int], words: str
) -> None:
    camera_photo(tmp_path / "a.jpg", size)
    (tmp_path / "camera.yaml").write_text(
        "model: brown\nwidth_px: 4000\nheight_px: 3000\n"
        "parameters: [2300, 2310, 2010, 1480, 0, 0, 0, 0, 0]\nsigma: [6, 6, 4, 4, 0, 0, 0, 0, 0]\n"
    )
    _table(tmp_path / "picks.csv", "image,label,u_px,v_px", [("a.jpg", "p", 20, 10)])

    with pytest.raises(InputError, match=words):
        check(write({"images": "*.jpg", "camera": "camera.yaml", "picks": "picks.csv"}))
