"""Reader and writer of results.json (schema 1): exact numbers, NaN as null, one record a line.

The reader returns an object equal to the written one. Keys are defined once for both directions: by
the types of the fields (io/json_codec.py), and by the tables and exceptions here.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from uavgram.errors import InputError
from uavgram.input_files import read_text
from uavgram.io.json_codec import (
    Json,
    Record,
    Table,
    decode,
    encode,
    from_record,
    join_records,
    numbers,
    parse_json,
)
from uavgram.io.outputs import replace_text
from uavgram.model.camera import Calibration
from uavgram.model.message import Message
from uavgram.model.naming import row_shapes
from uavgram.model.provenance import InputDigest, Provenance
from uavgram.model.result import reliability, tables
from uavgram.model.result.result import (
    AreaPlane,
    OrientationCorrelation,
    Result,
    SharedResult,
    SolutionSummary,
    compare_cameras,
)
from uavgram.model.survey import Geodetic, World

_ELLIPSE = ("ellipse_95_m", "ellipse_azimuth_rad")
FRAMES = Table(tables.FrameResults, elsewhere=("seed", "refined", "folder"))
POSES = Table(tables.PoseTable)
POINTS = Table(tables.PointResults, elsewhere=(*_ELLIPSE, "relative"))
RELATIVE = Table(tables.PlanarUncertainty, elsewhere=_ELLIPSE)
LINES = Table(tables.LineResults)
KNOWN = Table(tables.KnownResults)
CONTROL_LINES = Table(tables.ControlLineResults)
PICKS = Table(tables.PickResults)
MEASUREMENTS = Table(tables.MeasurementResults, elsewhere=("correlation",))
PROFILES = Table(tables.ProfileResults)
POINT_CHECKS = Table(tables.PointChecks)
LINE_CHECKS = Table(tables.LineChecks)
PRIORS = Table(reliability.PriorResults, elsewhere=("effects",))
EFFECTS = Table(reliability.Effects)
WEAKEST = Table(reliability.WeakestLinks)
SECOND_ORDER = Table(reliability.SecondOrder)


def dump_frames(frames: tables.FrameResults) -> list[Record]:
    """Return the frames; a missing pose is null."""
    seed, refined = _dump_poses(frames.seed), _dump_poses(frames.refined)
    poses = [{"seed": a, "refined": b} for a, b in zip(seed, refined, strict=True)]
    return join_records(FRAMES.dump(frames), poses)


def load_frames(records: Sequence[Record]) -> tables.FrameResults:
    """Invert `dump_frames`."""
    return FRAMES.load(
        records, **{key: _load_poses([row[key] for row in records]) for key in ("seed", "refined")}
    )


def _dump_poses(poses: tables.PoseTable) -> list[Record | None]:
    present = [bool(np.isfinite(center).any()) for center in poses.center_world_m]
    return [row if there else None for there, row in zip(present, POSES.dump(poses), strict=True)]


def _load_poses(rows: Sequence[Record | None]) -> tables.PoseTable:
    shapes = row_shapes(tables.PoseTable).items()
    absent = {key: encode(np.full(shape, np.nan)) for key, shape in shapes}
    return POSES.load([row or absent for row in rows])


def dump_points(points: tables.PointResults) -> list[Record]:
    """Return the ground points; angles in degrees for people, and in the original radians."""
    relative = join_records(RELATIVE.dump(points.relative), _dump_ellipses(points.relative))
    for row, off_ground in zip(relative, points.is_off_ground, strict=True):
        if not off_ground:
            del row["covariance_m3"]
    return join_records(
        POINTS.dump(points), _dump_ellipses(points), [{"relative": row} for row in relative]
    )


def load_points(records: Sequence[Record]) -> tables.PointResults:
    """Invert `dump_points`."""
    nothing = {"covariance_m3": [[None] * 3] * 3}  # left out for points on the ground
    relative = [nothing | row["relative"] for row in records]
    return POINTS.load(
        records,
        **_load_ellipses(records),
        relative=RELATIVE.load(relative, **_load_ellipses(relative)),
    )


def _dump_ellipses(points: tables.PointResults | tables.PlanarUncertainty) -> list[Record]:
    axes, azimuth = points.ellipse_95_m, points.ellipse_azimuth_rad
    keys = ("semi_major_m", "semi_minor_m", "azimuth_deg", "azimuth_rad")
    rows = np.column_stack([axes, np.rad2deg(azimuth), azimuth]).tolist()
    return [{"ellipse_95": dict(zip(keys, row, strict=True))} for row in rows]


def _load_ellipses(records: Sequence[Record]) -> Record:
    ellipses = [row["ellipse_95"] for row in records]
    axes = [[ellipse["semi_major_m"], ellipse["semi_minor_m"]] for ellipse in ellipses]
    azimuth = [ellipse["azimuth_rad"] for ellipse in ellipses]
    return {
        "ellipse_95_m": numbers(axes, len(records), 2),
        "ellipse_azimuth_rad": numbers(azimuth, len(records)),
    }


def load_measurements(records: Sequence[Record], correlation: Json) -> tables.MeasurementResults:
    """Read the measured values with their correlation."""
    n = len(records)
    return MEASUREMENTS.load(
        records,
        correlation=numbers(correlation, n, n),
    )


def add_evidence(result: Result, content: Record) -> Record:
    """Add the reliability of lengths, picks, priors and measurements, row by row."""
    if (evidence := result.evidence) is not None:
        content["lines"] = join_records(content["lines"], EFFECTS.dump(evidence.lines))
        content["picks"] = join_records(content["picks"], EFFECTS.dump(evidence.picks))
        content["measurements"] = join_records(
            content["measurements"], _dump_weakest(evidence.weakest)
        )
        priors = evidence.priors
        content["priors"] = join_records(PRIORS.dump(priors), EFFECTS.dump(priors.effects))
    if result.second_order is not None:
        content["measurements"] = join_records(
            content["measurements"], SECOND_ORDER.dump(result.second_order)
        )
    return content


def load_evidence(content: Record) -> reliability.Evidence | None:
    """Read the evidence of a results file; None where it has none."""
    if "priors" not in content:
        return None
    priors = content["priors"]
    return reliability.Evidence(
        lines=EFFECTS.load(content["lines"]),
        picks=EFFECTS.load(content["picks"]),
        priors=PRIORS.load(priors, effects=EFFECTS.load(priors)),
        weakest=_load_weakest(content["measurements"]),
    )


def load_second_order(records: Sequence[Record]) -> reliability.SecondOrder | None:
    """Read the second-order terms of the measurements; None where there are none."""
    if not records or "second_order_sigma" not in records[0]:
        return None
    return SECOND_ORDER.load(records)


def _dump_weakest(weakest: reliability.WeakestLinks) -> list[Record]:
    rows = WEAKEST.dump(weakest)
    unchecked = [row.pop("unchecked") for row in rows]
    return [
        {"weakest": row if row["what"] else None, "unchecked": names}
        for row, names in zip(rows, unchecked, strict=True)
    ]


def _load_weakest(records: Sequence[Record]) -> reliability.WeakestLinks:
    none = {"what": "", "mdb": None, "unit": "", "change": None}
    return WEAKEST.load(
        [(row["weakest"] or none) | {"unchecked": row["unchecked"]} for row in records]
    )


SCHEMA = 1


def dump_results(result: Result) -> str:
    """Return a result as the text of results.json.

    Deterministic: the same result gives the same text. Floats are written by repr (shortest text
    that reads back as the same number).

    Raises
    ------
    ValueError
        A number is infinite, which is a bug.
    """
    content = {
        "schema": SCHEMA,
        "name": result.name,
        "verdict": encode(result.verdict),
        "provenance": encode(result.provenance)
        | {
            "inputs": dump_inputs(result.provenance.inputs),
            "options": dict(result.provenance.options),
            "packages": dict(result.provenance.packages),
        },
        "world": _dump_world(result.world),
        "camera": encode(result.camera),
        "clock": _dump_clock(result.shared),
        "shared": _dump_shared(result),
        "areas": encode(result.areas),
        "frames": dump_frames(result.frames),
        "points": dump_points(result.points),
        "lines": LINES.dump(result.lines),
        "known": KNOWN.dump(result.known),
        "control_lines": CONTROL_LINES.dump(result.control_lines),
        "picks": PICKS.dump(result.picks),
        "measurements": MEASUREMENTS.dump(result.measurements),
        "measurement_correlation": encode(result.measurements.correlation),
        "profiles": PROFILES.dump(result.profiles),
        "monte_carlo": encode(result.monte_carlo),
        "removals": [
            {"step": step} | encode(one) for step, one in enumerate(result.removals, start=1)
        ],
        "checks_overall": encode(result.checks_overall),
        "checks": POINT_CHECKS.dump(result.point_checks) + LINE_CHECKS.dump(result.line_checks),
        "solution": encode(result.solution),
        "noise": _dump_noise(result.noise),
        "orientation": encode(result.orientation),
        "ties": encode(result.ties),
        "messages": [message.record() for message in result.messages],
    }
    if (budget := result.error_budget) is not None:
        content["error_budget"] = {"sources": list(budget.source), "shares": encode(budget.share)}
    return format_record_per_line(add_evidence(result, content))


def write_results(result: Result, path: str | Path) -> None:
    """Write results.json, in one step.

    Raises
    ------
    OutputError
        The file cannot be written; an earlier one is unchanged.
    """
    replace_text(Path(path), dump_results(result))


def load_results(path: str | Path) -> Result:
    """Read results.json as an object equal to the written one.

    Raises
    ------
    InputError
        The file cannot be read, is incomplete, is not JSON, is of another schema, or lacks a key.
    """
    path = Path(path)
    content = _parse(path)
    try:
        return _result(content)
    except (KeyError, TypeError, ValueError, IndexError) as fault:
        what = f"there is no key {fault}" if isinstance(fault, KeyError) else str(fault)
        raise InputError(
            path, f"is not a complete results file of schema {SCHEMA} ({what}): run again"
        ) from fault


def _result(content: Record) -> Result:
    checks, rows = content["checks"], content["measurements"]
    return Result(
        name=decode(str, content["name"]),
        provenance=_load_provenance(content["provenance"]),
        world=_load_world(content["world"]),
        camera=from_record(Calibration, content["camera"]),
        shared=_load_shared(content["shared"], content["clock"]),
        areas=decode(tuple[AreaPlane, ...], content["areas"]),
        frames=load_frames(content["frames"]),
        points=load_points(content["points"]),
        lines=LINES.load(content["lines"]),
        known=KNOWN.load(content["known"]),
        control_lines=CONTROL_LINES.load(content["control_lines"]),
        picks=PICKS.load(content["picks"]),
        measurements=load_measurements(rows, content["measurement_correlation"]),
        profiles=PROFILES.load(content["profiles"]),
        monte_carlo=decode(tables.MonteCarloResults | None, content["monte_carlo"]),
        second_order=load_second_order(rows),
        evidence=load_evidence(content),
        removals=decode(tuple[reliability.RemovalRecord, ...], content["removals"]),
        error_budget=_load_error_budget(content.get("error_budget")),
        checks_overall=decode(reliability.ChecksOverall | None, content["checks_overall"]),
        point_checks=POINT_CHECKS.load([c for c in checks if "label" in c]),
        line_checks=LINE_CHECKS.load([c for c in checks if "label" not in c]),
        solution=from_record(SolutionSummary, content["solution"]),
        noise=_load_noise(content["noise"]),
        orientation=decode(OrientationCorrelation | None, content["orientation"]),
        ties=decode(tables.TieSummary | None, content["ties"]),
        messages=decode(tuple[Message, ...], content["messages"]),
        verdict=from_record(reliability.Verdict, content["verdict"]),
    )


def format_record_per_line(content: dict[str, Any]) -> str:
    """Return JSON with a line for each key, and for each record of a list, fit for diff."""
    compact = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
    lines = []
    for key, value in content.items():
        if isinstance(value, list) and value:
            text = "[\n  " + ",\n  ".join(map(compact, value)) + "\n ]"
        else:
            text = compact(value)
        lines.append(f" {json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _parse(path: Path) -> dict[str, Any]:
    text = read_text(path, "so it is no results file")
    try:
        content = parse_json(path, text, constant=_refuse_constant)
    except json.JSONDecodeError as fault:
        raise InputError(
            path,
            f"is not complete JSON ({fault.msg}): it was cut short or edited; run again",
            fault.lineno,
        ) from fault
    except ValueError as fault:
        raise InputError(path, f"{fault}: it was edited; run again") from fault
    if not isinstance(content, dict) or "schema" not in content:
        raise InputError(path, "is no results file: it names no schema")
    if content["schema"] != SCHEMA:
        raise InputError(
            path,
            f"is of schema {content['schema']!r}, this program reads schema {SCHEMA}: read it with "
            "the version that wrote it (provenance.version), or run again",
        )
    return content


def _refuse_constant(name: str) -> float:
    raise ValueError(f"holds {name}, which is no JSON")


def _dump_world(world: World) -> Record:
    place = dict.fromkeys(Geodetic._fields) if world.origin is None else world.origin._asdict()
    own = {key: getattr(world, key) for key in ("height_datum", "gauge", "crs", "undulation_m")}
    return {**place, **own}


def _load_world(record: Record) -> World:
    place = decode(tuple[float, ...], [record[key] for key in Geodetic._fields])
    known = np.isfinite(place).all()
    return from_record(World, record, origin=Geodetic(*place) if known else None)


def dump_inputs(inputs: Iterable[InputDigest]) -> Record:
    """Return size and digest of each file, by its path."""
    return {one.path: {"sha256": one.sha256, "bytes": one.size_bytes} for one in inputs}


def _load_provenance(record: Record) -> Provenance:
    """Read the provenance; inputs are stored by their paths."""
    return from_record(
        Provenance,
        record,
        inputs=tuple(
            InputDigest(
                path=path,
                sha256=decode(str, one["sha256"]),
                size_bytes=decode(int, one["bytes"]),
            )
            for path, one in record["inputs"].items()
        ),
    )


LEARNT_KEYS = {"ratio": "sigma_ratio", "shift": "shift_prior_sigmas"}
_TELEMETRY = ("boresight_deg", "lever_arm_m", "position_bias_m", "heading_bias_deg")


def _dump_clock(shared: SharedResult) -> Record:
    """Return the camera clock minus UTC; null without a log."""
    none = {"value": None, "sigma": None}
    offset = encode(shared.clock_offset_s) or none
    drift = encode(shared.clock_drift_ppm) or none
    return {
        "offset_s": offset["value"],
        "sigma_s": offset["sigma"],
        "drift_ppm": drift["value"],
        "drift_sigma_ppm": drift["sigma"],
    }


def _dump_shared(result: Result) -> Record:
    """Return the shared unknowns, each with value and sigma; null where there is none.

    The camera's are compared with the calibration before the survey.
    """
    shared = result.shared
    learnt = compare_cameras(result.camera, shared.intrinsics)
    return {
        **{key: encode(getattr(shared, key)) for key in _TELEMETRY},
        "readout_s": encode(shared.readout_s),
        "plane": _remove_key(encode(result.plane), "name"),
        "tape_scale": encode(shared.tape_scale),
        "intrinsics": {LEARNT_KEYS.get(key, key): value for key, value in encode(learnt).items()},
    }


def _load_shared(record: Record, clock: Record) -> SharedResult:
    """Invert `_dump_shared` and `_dump_clock`; the plane is stored with the areas."""
    offset, drift = (
        None if clock[value] is None else {"value": clock[value], "sigma": clock[sigma]}
        for value, sigma in (("offset_s", "sigma_s"), ("drift_ppm", "drift_sigma_ppm"))
    )
    return from_record(SharedResult, record | {"clock_offset_s": offset, "clock_drift_ppm": drift})


def _dump_noise(noise: reliability.Noise | None) -> Record | None:
    """Return the noise: picks by source, roughness by area, lengths and identification."""
    if noise is None:
        return None
    return {
        "picks": {one.source: _remove_key(encode(one), "source") for one in noise.picks},
        "roughness": {one.area: _remove_key(encode(one), "area") for one in noise.roughness},
        "lengths": encode(noise.lengths),
        "identification": encode(noise.identification),
    }


def _remove_key(record: Record, key: str) -> Record:
    return {other: value for other, value in record.items() if other != key}


def _load_noise(record: Record | None) -> reliability.Noise | None:
    """Invert `_dump_noise`."""
    if record is None:
        return None
    return from_record(
        reliability.Noise,
        record,
        picks=tuple(
            from_record(reliability.PickNoise, one, source=source)
            for source, one in record["picks"].items()
        ),
        roughness=tuple(
            from_record(reliability.AreaNoise, one, area=area)
            for area, one in record["roughness"].items()
        ),
    )


def _load_error_budget(record: Record | None) -> reliability.ErrorBudget | None:
    """Read the shares of the variance of each measurement, by source."""
    if record is None:
        return None
    sources = decode(tuple[str, ...], record["sources"])
    shares = numbers(record["shares"], len(record["shares"]), len(sources))
    return reliability.ErrorBudget(source=sources, share=shares)
