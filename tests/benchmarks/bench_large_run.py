"""A whole `run` of a large survey: processor time and memory of every step.

    python tests/benchmarks/bench_large_run.py [FRAMES] [POINTS] [MEASUREMENTS] [FOLDER]

A mapping flight of FRAMES (500) stand-in photos of 600 x 450, all of one picture, in lanes 10 m
apart at 40 m: POINTS (2.5 a frame) on the ground, each picked in the five photos nearest to it, a
known length on one in fifty, MEASUREMENTS (1,000) distances between neighbours. FOLDER keeps the
project.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from scipy.signal import lfilter
from scipy.spatial import cKDTree

from uavgram.geometry.camera.projection import project
from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.geometry.motion.rotation import matrix_from_ypr
from uavgram.io.logs.tlog.writer import write_tlog
from uavgram.io.photos.tagging import insert_exif
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import SimulatedLog
from uavgram.pipeline.measure.run import Journal, run

HOME = np.array([50.0, 8.0, 200.0])
HEIGHT_M, SPACING_M, STEP_S = 40.0, 10.0, 2.0
CAMERA = np.array([450.0, 450.0, 299.5, 224.5, -0.05, 0.02, 0.0, 0.0, 0.0])
WIDTH_PX, HEIGHT_PX, SIGMA_PX = 600, 450, 0.3
BOOT_UTC_S, START_S, RATE_HZ = 1_780_000_000.0, 30.0, 10.0


def write(folder: Path, frames: int, points: int, measurements: int) -> Path:
    """Write the project; its file."""
    rng = np.random.default_rng(0)
    time_s = START_S + STEP_S * np.arange(frames) + rng.uniform(0, 0.4, frames)
    log, center, rotation = _flight(rng, time_s)
    (folder / "photos").mkdir(parents=True, exist_ok=True)
    _write_photos(folder / "photos", time_s)
    write_tlog(folder / "flight.tlog", log)
    place = np.zeros((points, 3))
    extent = center[:, :2].max(0)
    place[:, :2] = rng.uniform(0, extent, (points, 2))
    _write_picks(folder / "picks.csv", rng, center, rotation, place)
    neighbour = np.asarray(cKDTree(place[:, :2]).query(place[:, :2], k=2)[1])[:, 1]
    chosen = rng.choice(points, min(points, measurements + points // 50), replace=False)
    taped, asked = chosen[: points // 50], chosen[points // 50 :]
    length = np.linalg.norm(place[taped] - place[neighbour[taped]], axis=1)
    length += rng.normal(0, 0.01, len(taped))
    rows = [
        f"L{k},P{k},P{neighbour[k]},{m:.4f},0.01,\n" for k, m in zip(taped, length, strict=True)
    ]
    (folder / "lines.csv").write_text("name,from,to,length_m,sigma_m,use\n" + "".join(rows))
    rows = [f"d{k},distance,P{k};P{neighbour[k]},\n" for k in asked]
    (folder / "measure.csv").write_text("name,kind,points,parameters\n" + "".join(rows))
    (folder / "camera.yaml").write_text(
        f"name: stand-in\nmodel: brown\nwidth_px: {WIDTH_PX}\nheight_px: {HEIGHT_PX}\n"
        f"parameters: {CAMERA.tolist()}\n"
        "sigma: [0.6, 0.6, 0.4, 0.4, 0.0015, 0.003, 0.0001, 0.0001, 0]\n"
    )
    path = folder / "project.yaml"
    path.write_text(
        "name: large\nimages: photos/*.jpg\nlog: flight.tlog\ncamera: camera.yaml\n"
        "picks: picks.csv\nlines: lines.csv\nmeasure: measure.csv\n"
        f"output: out\npicks_sigma_px: {SIGMA_PX}\n"
        "time: {offset_s: 0.0, offset_sigma_s: 0.05}\n"
    )
    return path


def _flight(rng: np.random.Generator, exposed_s: Floats) -> tuple[SimulatedLog, Floats, Floats]:
    """What the autopilot recorded, and where the photos really were taken."""
    frames = len(exposed_s)
    side = round(np.sqrt(frames))
    lane, along = np.divmod(np.arange(frames + side), side)
    way = SPACING_M * np.column_stack([np.where(lane % 2, side - 1 - along, along), lane])
    turn = np.pi / 2 + np.pi * (lane % 2)
    at_s = START_S + STEP_S * np.arange(len(way))
    time_s = np.arange(START_S - 8.0, exposed_s[-1] + 8.0, 1 / RATE_HZ)

    def truly(t: Floats) -> tuple[Floats, Floats]:
        place = np.column_stack([np.interp(t, at_s, way[:, k]) for k in (0, 1)])
        waver = np.column_stack([np.sin(t / p + p) for p in (3.1, 4.3, 7.7)])
        angles = np.column_stack([0.02 * waver[:, :2], np.interp(t, at_s, turn)])
        return np.column_stack([place, HEIGHT_M + 0.3 * waver[:, 2]]), angles

    def wander(sigma: Floats, tau_s: float) -> Floats:
        keep = np.exp(-1 / (RATE_HZ * tau_s))
        steps = rng.normal(0, 1, (len(time_s), 3)) * np.sqrt(1 - keep**2)
        return np.asarray(sigma * lfilter([1.0], [1.0, -keep], steps, axis=0))

    center, angles = truly(exposed_s)
    true_place, true_angles = truly(time_s)
    place = true_place + wander(np.array([0.35, 0.35, 0.4]), 40.0) + [0.8, -0.6, 0.9]
    logged = true_angles + wander(np.deg2rad([0.4, 0.4, 0.8]), 3.0)
    fixes = slice(None, None, 2)
    log = SimulatedLog(
        boot_utc_s=BOOT_UTC_S,
        home_geodetic=HOME,
        undulation_m=47.0,
        position_time_s=time_s,
        position_geodetic=_geodetic(place),
        velocity_ned_m_s=np.gradient(place, time_s, axis=0)[:, [1, 0, 2]] * [1, 1, -1],
        attitude_time_s=time_s,
        attitude_rpy_rad=logged,
        gimbal_time_s=time_s,
        gimbal_rpy_rad=np.tile([0.0, -np.pi / 2 + 1e-3, 0.0], (len(time_s), 1)),
        gps_time_s=time_s[fixes],
        gps_geodetic=_geodetic(place[fixes] + rng.normal(0, 0.3, (len(time_s[fixes]), 3))),
        gps_accuracy_m=np.tile([1.2, 1.8], (len(time_s[fixes]), 1)),
        event_time_s=exposed_s,
        event_geodetic=_geodetic(center),
        event_rpy_rad=angles,
    )
    # Camera axes right, down, forward; the gimbal keeps it level and looking down, nose up.
    heading = matrix_from_ypr(angles[:, 2], np.zeros(frames), np.zeros(frames))
    enu_from_ned = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
    body_from_camera = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    return log, center, enu_from_ned @ heading @ body_from_camera


def _geodetic(place: Floats) -> Floats:
    return np.column_stack(geodetic_from_enu(place, (HOME[0], HOME[1], HOME[2])))


def _write_photos(folder: Path, time_s: Floats) -> None:
    picture = cv2.resize(
        np.random.default_rng(1).integers(0, 255, (45, 60, 3), np.uint8), (WIDTH_PX, HEIGHT_PX)
    )
    jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 70])[1].tobytes()
    for k, t in enumerate((BOOT_UTC_S + time_s).tolist()):
        tagged = insert_exif(jpeg, time_utc_s=t, zone_h=0.0, make="stand-in", model="one")
        (folder / f"DSC_{k:05d}.jpg").write_bytes(tagged)


def _write_picks(
    path: Path, rng: np.random.Generator, center: Floats, rotation: Floats, place: Floats
) -> None:
    nearest = np.asarray(cKDTree(center[:, :2]).query(place[:, :2], k=5)[1])
    frame, label = nearest.ravel(), np.repeat(np.arange(len(place)), 5)
    seen = np.einsum("nji,nj->ni", rotation[frame], place[label] - center[frame])
    pixel = project("brown", CAMERA, seen) + rng.normal(0, SIGMA_PX, (len(frame), 2))
    inside = (pixel > 3).all(1) & (pixel < [WIDTH_PX - 4, HEIGHT_PX - 4]).all(1)
    rows = zip(frame[inside], label[inside], *pixel[inside].T, strict=True)
    with path.open("w", encoding="utf-8") as file:
        file.write("image,label,u_px,v_px\n")
        file.writelines(f"DSC_{i:05d}.jpg,P{k},{u:.3f},{v:.3f}\n" for i, k, u, v in rows)


@contextmanager
def _measured_step(self: Journal, name: str) -> Iterator[None]:
    before = _cpu_s()
    Path("/proc/self/clear_refs").write_text("5")  # the high-water mark begins anew
    started = time.perf_counter()
    yield
    wall, cpu = time.perf_counter() - started, _cpu_s() - before
    print(f"{name:48s} {cpu:8.2f} s of processor {wall:8.2f} s {_peak_mb():8.0f} MB", flush=True)
    self.note("step", name=name, seconds=round(wall, 4))


def _cpu_s() -> float:
    return sum(
        used.ru_utime + used.ru_stime
        for used in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def _peak_mb() -> float:
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def main(frames: int, points: int, measurements: int, folder: str) -> int:
    """Write the project where it is not yet, run it, and say what each step took."""
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(folder or scratch)
        project = root / "project.yaml"
        if not project.exists():
            project = write(root, frames, points or 5 * frames // 2, measurements)
        Journal.step = _measured_step  # type: ignore[method-assign]
        before, started = _cpu_s(), time.perf_counter()
        result = run(project)
        cpu, wall = _cpu_s() - before, time.perf_counter() - started
    points, measurements = len(result.points.label), len(result.measurements.name)
    size = f"{frames} frames, {points} points, {measurements} measured"
    print(
        f"{size}: {result.verdict}, {cpu:.1f} s of processor, {1e3 * cpu / frames:.2f} ms a frame, "
        f"{wall:.1f} s"
    )
    return 0


if __name__ == "__main__":
    asked = [*map(int, sys.argv[1:4]), *(500, 0, 1000)[len(sys.argv[1:4]) :]]
    sys.exit(main(asked[0], asked[1], asked[2], "".join(sys.argv[4:5])))
