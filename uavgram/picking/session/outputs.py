"""Outputs of a run for the page: files by name, results in words, and the recording."""

from __future__ import annotations

import json
import logging
import threading
from contextlib import suppress
from pathlib import Path

from uavgram.errors import InputError, OutputError, UavgramError
from uavgram.io.files import check_own, read_own
from uavgram.io.outputs import find_latest
from uavgram.io.results.results_json import load_results
from uavgram.model.provenance import case_from_options
from uavgram.model.result.result import Result
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.ways_on_page import name_on_page
from uavgram.picking.storage.tables import Stamp, stamp_of
from uavgram.views.formatting import measurement_text, order_shapes_first
from uavgram.views.survey.verdict import (
    describe_undetectable,
    reason_sentence,
    status_text,
    summarise_result,
    verdict_words,
)
from uavgram.views.units import convert_sentence, exact_lengths, list_names_like_lengths, units_of
from uavgram.views.viewer import RecordingServer

log = logging.getLogger(__name__)

REPORT = "report.html"
RESULTS = "results.json"
RECORDING = "recording.rrd"
OF_EARTH = {"points.geojson", "survey.kml"}
"""Files that are empty where nothing ties the survey to the earth."""

FILES = {
    REPORT: "Report",
    "report-annex.html": "Annex of the report, for specialists",
    "measurements.csv": "Measurements (CSV)",
    "survey_local.dxf": "Drawing, local metres (DXF)",
    "survey_map.dxf": "Drawing, map coordinates (DXF)",
    "survey.gpkg": "Layers for GIS (GeoPackage)",
    "points.geojson": "Points (GeoJSON)",
    "survey.kml": "For Google Earth (KML)",
    "ground.tif": "Picture of the ground, to scale (GeoTIFF)",
    RESULTS: "All results (JSON)",
}
"""Files that the page serves, with their titles; no others are served."""


class Outputs:
    """Files of a project's output folder.

    Parameters
    ----------
    folder
        The output folder.

    Attributes
    ----------
    made_of
        Digests of the inputs of the results, as `look` last found them; None without results.
    is_on_earth
        Whether the results have a place on the earth, as `look` last found them.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._viewer: RecordingServer | None = None
        self._opening = threading.Lock()
        self._stamp: Stamp = None
        self.made_of: frozenset[str] | None = None
        self.is_on_earth = True
        self.look()

    def look(self) -> None:
        """Read the inputs of the results, even if another program wrote them; slow when new."""
        stamp = stamp_of(self._latest(RESULTS))
        if stamp == self._stamp:
            return
        self._stamp, self.made_of = stamp, None
        with suppress(ValueError, KeyError, TypeError, AttributeError, RecursionError):
            results = json.loads(self.read(RESULTS) or b"")
            inputs = results["provenance"]["inputs"]
            self.made_of = frozenset(str(one["sha256"]) for one in inputs.values())
            self.is_on_earth = results["world"]["latitude_deg"] is not None

    def summarise_results(self) -> m.Results | None:
        """Return the results in words; None if there are none or they cannot be read."""
        if not self._has(RESULTS):
            return None
        with suppress(UavgramError):
            return results_json(load_results(self._latest(RESULTS)))
        return None

    def plan(self) -> bytes | None:
        """Return the plan of the report as SVG; None if there is none."""
        report = self.read(REPORT)
        return None if report is None else extract_plan(report)

    @property
    def stamp(self) -> str:
        """Identifier that changes with each results.json that `look` finds; empty without one."""
        return "" if self._stamp is None else "-".join(map(str, self._stamp))

    def list_files(self) -> list[m.OutputFile]:
        """Return the existing files with their titles; a file beside a locked one has its name."""
        named = [name for name in FILES if self.is_on_earth or name not in OF_EARTH]
        latest = {name: self._latest(name).name for name in named if self._has(name)}
        return [
            {"name": name, "words": FILES[name] + (f": {file}" if file != name else "")}
            for name, file in latest.items()
        ]

    @property
    def has_recording(self) -> bool:
        """Return whether there is a recording."""
        return self._has(RECORDING)

    def _has(self, name: str) -> bool:
        """Return whether this file exists as a run wrote it; links are not followed."""
        path = self._latest(name)
        with suppress(OutputError):
            check_own(path)
            return path.is_file()
        return False

    def _latest(self, name: str) -> Path:
        """Return the newest file of a name: beside the other, where another program held that."""
        return find_latest(self.folder / name)

    def read(self, name: str) -> bytes | None:
        """Return the content of one of `FILES`; None if it is missing, a link, or another file."""
        if name not in FILES:
            return None
        with suppress(OSError, OutputError):
            return read_own(self._latest(name))
        return None

    def viewer(self) -> str:
        """Return the address of the Rerun viewer with the recording, on this machine only.

        Raises
        ------
        UavgramError
            There is no recording, or the viewer could not run.
        """
        with self._opening:
            if not self.has_recording:
                raise InputError(self.folder / RECORDING, "is not there yet: write it on the page")
            if self._viewer is None or not self._viewer.is_up:
                self._stop()
                self._viewer = RecordingServer(self._latest(RECORDING))
            return self._viewer.address

    def close(self) -> None:
        """Stop the viewer."""
        with self._opening:
            self._stop()

    def _stop(self) -> None:
        if self._viewer is not None:
            self._viewer.stop()
            self._viewer = None


def results_json(result: Result) -> m.Results:
    """Return verdict, measurements and case of a result, in the units of its project.

    Measurements are in the order of the project, coordinates last.
    """
    words, units = verdict_words(result), units_of(result)
    reasons = words.reasons
    first = reason_sentence(reasons[0]) if reasons else describe_undetectable(result)
    keep, exact = list_names_like_lengths(result), exact_lengths(result)

    def in_project_units(text: str) -> str:
        return name_on_page(convert_sentence(text, units, keep, exact))

    rows = result.measurements
    return {
        "level": words.level,
        "headline": in_project_units(summarise_result(result)),
        "first": in_project_units(first),
        "others": [in_project_units(reason.text) for reason in reasons[1:]],
        "scale": in_project_units(words.scale),
        "counts": words.counts,
        "case": list(case_from_options(result.provenance.options)),
        "made": result.provenance.created_utc,
        "measurements": [
            {
                "name": text.name,
                "kind": text.kind,
                "points": list(text.points),
                "value": text.value,
                "others": text.others,
                "interval": text.interval,
                "status": rows.status[k],
                "words": status_text(rows, k),
            }
            for k in order_shapes_first(rows)
            for text in [measurement_text(rows, k, units)]
        ],
    }


def extract_plan(report: bytes) -> bytes | None:
    """Extract the plan on a report's first page as a separate drawing; None if there is none."""
    begin = report.find(b'<svg class="drawing"')
    end = report.find(b"</svg>", begin)
    if begin < 0 or end < 0:
        return None
    name = b'<svg xmlns="http://www.w3.org/2000/svg"'
    return name + report[begin + len(b"<svg") : end] + b"</svg>"
