"""The parts of `Result` that are no tables <-> plain data of results.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from uavgram.io.results.tables import numbers, one_of, plain, text
from uavgram.model.camera.calibration import Calibration, LensModel
from uavgram.model.message import SUBJECTS, Message
from uavgram.model.provenance import InputDigest, Provenance
from uavgram.model.result.error_budget import ErrorBudget
from uavgram.model.result.learnt_camera import learnt_camera
from uavgram.model.result.result import Alternative, GroupFactor, SolutionSummary
from uavgram.model.result.shared import AreaPlane, Estimate, SharedResult
from uavgram.model.result.tables import MonteCarloResults
from uavgram.model.survey.world import World

Record = dict[str, Any]


def dump_provenance(provenance: Provenance) -> Record:
    """What made the result."""
    return {
        "program": provenance.program,
        "version": provenance.version,
        "created_utc": provenance.created_utc,
        "made_by": provenance.made_by,
        "inputs": {
            one.path: {"sha256": one.sha256, "bytes": one.size_bytes} for one in provenance.inputs
        },
        "options": dict(provenance.options),
        "seed": provenance.seed,
        "packages": dict(provenance.packages),
    }


def load_provenance(record: Record) -> Provenance:
    """Inverse of `dump_provenance`; lists in the options become tuples."""
    return Provenance(
        program=text(record["program"]),
        version=text(record["version"]),
        created_utc=text(record["created_utc"]),
        made_by=text(record.get("made_by", "")),
        inputs=tuple(
            InputDigest(path=path, sha256=text(one["sha256"]), size_bytes=_whole(one["bytes"]))
            for path, one in record["inputs"].items()
        ),
        options=tuple((key, _frozen(value)) for key, value in record["options"].items()),
        seed=None if record["seed"] is None else _whole(record["seed"]),
        packages=tuple((name, text(version)) for name, version in record["packages"].items()),
    )


def load_message(record: Record) -> Message:
    """Inverse of `Message.record`; files of before name no subjects."""
    subjects = {what: tuple(map(text, record.get(what, ()))) for what in SUBJECTS}
    level = one_of(Message, "level", record["level"])
    return Message(level, text(record["code"]), text(record["text"]), **subjects, several=None)


def _frozen(value: Any) -> Any:  # noqa: ANN401
    return tuple(_frozen(item) for item in value) if isinstance(value, list) else value


def _whole(value: Any) -> int:  # noqa: ANN401
    if not isinstance(value, int) or isinstance(value, bool):
        raise TypeError(f"expected a whole number, got {value!r}")
    return value


def truth(value: Any) -> bool:  # noqa: ANN401
    """A truth value as it is; anything else is a TypeError."""
    if not isinstance(value, bool):
        raise TypeError(f"expected true or false, got {value!r}")
    return value


def _number(value: Any) -> float:  # noqa: ANN401
    return float(numbers(value))


def _number_or_none(value: Any) -> float | None:  # noqa: ANN401
    return None if value is None else _number(value)


def dump_world(world: World) -> Record:
    """Origin of the local world."""
    return {
        "latitude_deg": world.latitude_deg,
        "longitude_deg": world.longitude_deg,
        "height_m": world.height_m,
        "height_datum": world.height_datum,
        "gauge": world.gauge,
        "crs": world.crs,
    }


def load_world(record: Record) -> World:
    """Inverse of `dump_world`."""
    return World(
        latitude_deg=_number_or_none(record["latitude_deg"]),
        longitude_deg=_number_or_none(record["longitude_deg"]),
        height_m=_number_or_none(record["height_m"]),
        height_datum=one_of(World, "height_datum", record["height_datum"]),
        gauge=one_of(World, "gauge", record["gauge"]),
        crs=None if record.get("crs") is None else text(record["crs"]),
    )


def dump_camera(camera: Calibration) -> Record:
    """The camera as given."""
    return {
        "name": camera.name,
        "model": camera.model,
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "parameters": plain(camera.parameters),
        "covariance": plain(camera.covariance),
    }


def load_camera(record: Record) -> Calibration:
    """Inverse of `dump_camera`."""
    model: LensModel = one_of(Calibration, "model", record["model"])
    n = len(record["parameters"])
    return Calibration(
        name=text(record["name"]),
        model=model,
        width_px=_whole(record["width_px"]),
        height_px=_whole(record["height_px"]),
        parameters=numbers(record["parameters"], n),
        covariance=numbers(record["covariance"], n, n),
    )


_VECTORS = ("boresight_deg", "lever_arm_m", "position_bias_m")


def dump_clock(shared: SharedResult) -> Record:
    """Camera clock minus UTC; null without a log."""
    clock, drift = shared.clock_offset_s, shared.clock_drift_ppm
    return {
        "offset_s": None if clock is None else plain(clock.value[0]),
        "sigma_s": None if clock is None else plain(clock.sigma[0]),
        "drift_ppm": None if drift is None else plain(drift.value[0]),
        "drift_sigma_ppm": None if drift is None else plain(drift.sigma[0]),
    }


def dump_shared(shared: SharedResult, camera: Calibration) -> Record:
    """Shared unknowns, each with value and sigma; null where there is none.

    The camera's also with the calibration they began with, and what the survey taught of it.
    """
    learnt = learnt_camera(camera, shared.intrinsics)
    return {
        **{key: _dump_vector(getattr(shared, key)) for key in _VECTORS},
        "heading_bias_deg": _dump_scalar(shared.heading_bias_deg),
        "plane": {
            "height_m": _dump_scalar(shared.plane_height_m),
            "slope_deg": _dump_vector(shared.plane_slope_deg),
            "pivot_m": plain(shared.plane_pivot_m),
        },
        "intrinsics": {
            "names": list(learnt.names),
            "value": plain(learnt.value),
            "sigma": plain(learnt.sigma),
            "prior_value": plain(learnt.prior_value),
            "prior_sigma": plain(learnt.prior_sigma),
            "sigma_ratio": plain(learnt.ratio),
            "shift_prior_sigmas": plain(learnt.shift),
            "learnt": learnt.learnt.tolist(),
        },
    }


def load_shared(record: Record, clock: Record) -> SharedResult:
    """Inverse of `dump_shared` and `dump_clock`."""
    plane = record["plane"]
    clock_pair = {"value": clock["offset_s"], "sigma": clock["sigma_s"]}
    drift = clock.get("drift_ppm")  # files of before have none
    return SharedResult(
        boresight_deg=_load_estimate(record["boresight_deg"]),
        lever_arm_m=_load_estimate(record["lever_arm_m"]),
        position_bias_m=_load_estimate(record["position_bias_m"]),
        heading_bias_deg=_load_estimate(record["heading_bias_deg"]),
        clock_offset_s=None if clock["offset_s"] is None else _estimate(clock_pair),
        clock_drift_ppm=None
        if drift is None
        else _estimate({"value": drift, "sigma": clock["drift_sigma_ppm"]}),
        plane_height_m=_estimate(plane["height_m"]),
        plane_slope_deg=_estimate(plane["slope_deg"]),
        plane_pivot_m=numbers(plane["pivot_m"], 2),
        intrinsics=_estimate(record["intrinsics"]),
    )


def dump_areas(areas: tuple[AreaPlane, ...]) -> list[Record]:
    """Planes of the ground by area."""
    return [
        {
            "name": area.name,
            "height_m": _dump_scalar(area.height_m),
            "slope_deg": _dump_vector(area.slope_deg),
            "pivot_m": plain(area.pivot_m),
        }
        for area in areas
    ]


def load_areas(records: list[Record]) -> tuple[AreaPlane, ...]:
    """Inverse of `dump_areas`."""
    return tuple(
        AreaPlane(
            name=text(record["name"]),
            height_m=_estimate(record["height_m"]),
            slope_deg=_estimate(record["slope_deg"]),
            pivot_m=numbers(record["pivot_m"], 2),
        )
        for record in records
    )


def _dump_vector(estimate: Estimate | None) -> Record | None:
    if estimate is None:
        return None
    return {"value": plain(estimate.value), "sigma": plain(estimate.sigma)}


def _dump_scalar(estimate: Estimate | None) -> Record | None:
    if estimate is None:
        return None
    (value,), (sigma,) = plain(estimate.value), plain(estimate.sigma)
    return {"value": value, "sigma": sigma}


def _estimate(record: Mapping[str, Any]) -> Estimate:
    pair = [v if isinstance(v, list) else [v] for v in (record["value"], record["sigma"])]
    value, sigma = (numbers(v, len(pair[0])) for v in pair)
    return Estimate(value=value, sigma=sigma)


def _load_estimate(record: Record | None) -> Estimate | None:
    return None if record is None else _estimate(record)


_GROUP_NUMBERS = ("redundancy", "variance_factor", "probability")
_ALTERNATIVE_NUMBERS = ("cost", "height_m", "tilt_deg")


def dump_solution(solution: SolutionSummary) -> Record:
    """How the adjustment went."""
    return {
        "degrees_of_freedom": solution.degrees_of_freedom,
        "variance_factor": plain(solution.variance_factor),
        "chi2_probability": plain(solution.chi2_probability),
        "iterations": solution.iterations,
        "converged": bool(solution.converged),
        "alternatives": [
            {
                "frame_id": one.frame_id,
                **{key: plain(getattr(one, key)) for key in _ALTERNATIVE_NUMBERS},
                "values": plain(one.values),
            }
            for one in solution.alternatives
        ],
        "groups": [
            {
                "name": one.name,
                "observations": one.observations,
                **{key: plain(getattr(one, key)) for key in _GROUP_NUMBERS},
            }
            for one in solution.groups
        ],
    }


def load_solution(record: Record) -> SolutionSummary:
    """Inverse of `dump_solution`."""
    return SolutionSummary(
        degrees_of_freedom=_whole(record["degrees_of_freedom"]),
        variance_factor=_number(record["variance_factor"]),
        chi2_probability=_number(record["chi2_probability"]),
        iterations=_whole(record["iterations"]),
        converged=truth(record["converged"]),
        alternatives=tuple(
            Alternative(
                frame_id=text(one["frame_id"]),
                values=tuple(numbers(one["values"], len(one["values"])).tolist()),
                **{key: _number(one[key]) for key in _ALTERNATIVE_NUMBERS},
            )
            for one in record["alternatives"]
        ),
        groups=tuple(
            GroupFactor(
                name=text(one["name"]),
                observations=_whole(one["observations"]),
                **{key: _number(one[key]) for key in _GROUP_NUMBERS},
            )
            for one in record["groups"]
        ),
    )


def dump_monte_carlo(sampled: MonteCarloResults | None) -> Record | None:
    """Sampled values, in the order of the measurements; null where none were asked for."""
    if sampled is None:
        return None
    return {
        "samples": sampled.samples,
        "failed": sampled.failed,
        "seed": sampled.seed,
        "mean": plain(sampled.mean),
        "sigma": plain(sampled.sigma),
        "interval_95": plain(sampled.interval_95),
    }


def load_monte_carlo(record: Record | None) -> MonteCarloResults | None:
    """Inverse of `dump_monte_carlo`."""
    if record is None:
        return None
    count = len(record["mean"])
    return MonteCarloResults(
        samples=record["samples"],
        failed=record["failed"],
        seed=record["seed"],
        mean=numbers(record["mean"], count),
        sigma=numbers(record["sigma"], count),
        interval_95=numbers(record["interval_95"], count, 2),
    )


def dump_error_budget(budget: ErrorBudget) -> Record:
    """Shares of the variance of each measurement, in their order, by source."""
    return {"sources": list(budget.source), "shares": plain(budget.share)}


def load_error_budget(record: Record | None) -> ErrorBudget | None:
    """Inverse of `dump_error_budget`; files of before have none."""
    if record is None:
        return None
    sources = tuple(text(source) for source in record["sources"])
    rows = len(record["shares"])
    return ErrorBudget(source=sources, share=numbers(record["shares"], rows, len(sources)))
