"""Writers of simulation.json and study.json: repetitions of a survey, and studies of photos."""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path

from uavgram.io.json_codec import Json, Record, encode
from uavgram.model.simulation import SOURCES, Accuracy, Repetitions, Simulation, Study

SIMULATION_SCHEMA = 1
SHARES = ("68", "95", "99.7")


def write_simulation(simulation: Simulation, path: Path) -> None:
    """Write simulation.json.

    Parameters
    ----------
    simulation
        Simulation to write.
    path
        Output file.
    """
    path.write_text(json.dumps(simulation_as_json(simulation), indent=1) + "\n", encoding="utf-8")


def simulation_as_json(simulation: Simulation) -> Record:
    """Convert to plain data: metres and degrees; ranges are of 95 %; None for missing values."""
    found = simulation.repetitions
    return {
        "schema": SIMULATION_SCHEMA,
        "name": simulation.name,
        "source": simulation.source,
        "seed": simulation.seed,
        **_summary(found, simulation.accuracy),
        "running": [
            {"repetitions": count, "spread_over_predicted": encode(ratio)}
            for count, ratio in simulation.running
        ],
        "drawn_unlike_stated": [encode(one) for one in simulation.unlike],
        "amiss": list(simulation.deviations),
        "variants": [
            {"name": one.name, **_summary(one.repetitions, one.accuracy)}
            for one in simulation.variants
        ],
        "draws": {
            "names": list(found.name),
            "number": encode(found.number),
            "true": encode(found.true),
            "value": encode(found.value),
            "sigma": encode(found.sigma),
            "converged": encode(found.converged),
            "level": list(found.level),
            "failure": list(found.failure),
            "codes": encode(found.codes),
        },
    }


def _summary(found: Repetitions, accuracy: Accuracy) -> Record:
    verdicts = Counter(level for level in found.level if level is not None)
    return {
        "repetitions": len(found.number),
        "failed": found.failed,
        "not_converged": found.unsettled,
        "verdicts": {level: verdicts.get(level, 0) for level in ("green", "amber", "red")},
        "measurements": [_measurement(found, accuracy, i) for i in range(len(found.name))],
    }


def _measurement(found: Repetitions, accuracy: Accuracy, i: int) -> Record:
    return {
        "name": found.name[i],
        "unit": found.unit[i],
        "count": int(accuracy.count[i]),
        "predicted_sigma": encode(found.predicted[i]),
        "stated_sigma": encode(accuracy.stated[i]),
        "bias": {"value": encode(accuracy.bias[i]), "range": encode(accuracy.bias_range[i])},
        "spread": {"value": encode(accuracy.spread[i]), "range": encode(accuracy.spread_range[i])},
        "z": {"value": encode(accuracy.z[i]), "range": encode(accuracy.z_range[i])},
        "coverage": {
            share: {
                "value": encode(accuracy.coverage[i, k]),
                "range": encode(accuracy.coverage_range[i, k]),
            }
            for k, share in enumerate(SHARES)
        },
    }


STUDY_SCHEMA = 1


def write_studies(studies: tuple[Study, ...], path: Path) -> None:
    """Write study.json: metres, seconds and shares; null for missing values.

    Parameters
    ----------
    studies
        Studies to write.
    path
        Output file.
    """
    record = {"schema": STUDY_SCHEMA, "sources": list(SOURCES), "studies": _finite(encode(studies))}
    path.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _finite(value: Json) -> Json:
    """Replace infinite numbers, of undetermined methods, which JSON cannot hold."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list):
        return [_finite(item) for item in value]
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return value
