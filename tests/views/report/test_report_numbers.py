"""Every number on the page is that of results.json, at the precision that is printed."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_survey as survey
from full_report import full
from html_page import Page
from numbers_told import agree

from uavgram.io.results.results_json import write_results
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.views.report import render_annex, render_report
from uavgram.views.survey.verdict import STATUS_WORDS

_DRAWING = re.compile(r'<svg class="drawing".*?</svg>', re.DOTALL)
AMOUNT = re.compile(
    r"an undetected error of (?P<bias>\S+)( \S+)? in the (?P<what>.+) "
    r"would move it by (?P<change>\S+) \S+$"
)


@dataclass(frozen=True)
class Outputs:
    """What results.json and the page say of one result."""

    file: dict[str, Any]
    tables: dict[tuple[str, ...], list[list[str]]]
    """Rows of the page by the heads of their table."""
    legend: str
    """Of the error budget."""
    first_page: str
    """HTML of what a judge reads, without its plan."""
    drawn: list[list[str]]
    """Texts of each plan."""

    def numbered(self, names: Iterable[str]) -> list[tuple[int, str]]:
        """Numbers that stand for names in the head of a table, as the legend has them."""
        found = re.findall(r"(\d+) ([a-z][a-z ]+?)(?:,|\.|$)", self.legend)
        assert {name for _, name in found} >= set(names), self.legend
        return [(int(number), name) for number, name in found if name in names]

    def table(self, *heads: str) -> list[list[str]]:
        """Rows of the one table whose first heads these are; none where there is no such table."""
        found = [rows for head, rows in self.tables.items() if head[: len(heads)] == heads]
        assert len(found) <= 1
        return found[0] if found else []


def outputs_of(result: Result, folder: Path) -> Outputs:
    write_results(result, folder / "results.json")
    tables: dict[tuple[str, ...], list[list[str]]] = {}
    head: tuple[str, ...] = ()
    html = render_report(result) + render_annex(result)
    page = Page(html)
    rows = iter(page.rows)
    for tag, _ in page.tags:
        if tag == "table":
            head = ()
        if tag == "tr":
            row = next(rows)
            if head:
                tables[head].append(row)
            else:
                head = tuple(cell.replace("\xad", "") for cell in row)
                tables[head] = []
    legend = re.search(r"Shares in percent: (.*?)</p>", html)
    return Outputs(
        file=json.loads((folder / "results.json").read_text(encoding="utf-8")),
        tables=tables,
        legend=re.sub(r"<.*?>", "", legend[1]) if legend else "",
        first_page=re.sub(r"<svg.*?</svg>", "", html[: html.index("</header>")], flags=re.DOTALL),
        drawn=[re.findall(r"<text[^>]*>(.*?)</text>", one) for one in _DRAWING.findall(html)],
    )


def pace_of(measured: dict[str, Any]) -> float:
    """Times what a report shows a value: speeds in km/h."""
    return 3.6 if measured["unit"] == "m/s" else 1.0


@pytest.fixture(scope="module", params=["full", "shape only", "a real flight"])
def both(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Outputs:
    tmp_path = tmp_path_factory.mktemp("results")
    if request.param == "full":
        return outputs_of(full(survey.build()), tmp_path)
    if request.param == "shape only":
        return outputs_of(survey.build(telemetry=False), tmp_path)
    project = request.getfixturevalue("data_dir") / "cuav" / "project.yaml"
    return outputs_of(compute(read_inputs(project)).result, tmp_path)


def test_measurements(both: Outputs) -> None:
    rows = {row[0]: row for row in both.table("name", "kind")}
    sampled = both.file["monte_carlo"]

    assert set(rows) == {one["name"] for one in both.file["measurements"]}
    for i, one in enumerate(both.file["measurements"]):
        cells = rows[one["name"]]
        assert cells[2] == " – ".join(one["points"])
        if one["value"] is None:
            assert cells[3] == cells[6] == "not computed"
            continue
        assert cells[6] == STATUS_WORDS[one["status"]]
        pace = pace_of(one)
        values = (one["value"], one["sigma"], *one["interval_95"])
        agree(cells[3:5], *(pace * value for value in values))
        if cells[5] != "–":
            agree(cells[5:6], 100 * one["sigma"] / abs(one["value"]))
        if sampled:
            both_sampled = (sampled["sigma"][i], *sampled["interval_95"][i])
            agree(cells[7:9], *(pace * value for value in both_sampled))


def test_first_page(both: Outputs) -> None:
    rows = both.table("measured", "what")
    measured = {one["name"]: one for one in both.file["measurements"]}

    assert 0 < len(rows) <= len(measured)
    for name, what, value, interval, status in rows:
        one = measured[name]
        assert what.endswith(one["points"][-1])
        pace = pace_of(one)
        computed = one["value"] is not None
        assert status.startswith(STATUS_WORDS[one["status"]] if computed else "not computed")
        if computed:
            wanted = (one["value"], one["sigma"], *one["interval_95"])
            agree([value, interval], *(pace * number for number in wanted))
    kinds = [measured[row[0]]["kind"] for row in rows]
    assert kinds == sorted(kinds, key=lambda kind: kind == "coordinate")
    counts = re.search(r"(\d+) of (\d+) photos used, (\d+) of (\d+) known", both.first_page)
    assert counts is not None
    frames, lines = both.file["frames"], both.file["lines"]
    assert [int(count) for count in counts.groups()] == [
        sum(one["status"] == "refined" for one in frames),
        len(frames),
        sum(one["status"] in ("used", "suspect") for one in lines),
        len(lines),
    ]


def test_both_accuracies_of_the_first_page(both: Outputs) -> None:
    points = both.file["points"]
    near = [one["neighbour_sigma_m"] for one in points if one["neighbour_sigma_m"] is not None]
    told = re.search(r"neighbouring points are known to about ± ([\d.]+) m\.", both.first_page)
    earth = re.search(r"on the earth is known to about ± ([\d.]+) m ", both.first_page)

    assert (told is None) == (not near)
    if told:
        agree([told[1]], np.median(near))
    assert (earth is None) == (both.file["world"]["gauge"] == "plane")
    if earth:
        traces = [np.trace(np.array(one["covariance_m2"])[:2, :2]) for one in points]
        agree([earth[1]], np.median(np.sqrt(np.array(traces) / 2)))


def test_dimensions_on_the_plans(both: Outputs) -> None:
    measured = {one["name"]: one for one in both.file["measurements"] if one["value"] is not None}
    taped = {one["name"]: one["length_m"] for one in both.file["lines"]}
    labels = {one["label"] for one in both.file["points"]}
    seen = 0

    for text in (text for drawing in both.drawn for text in drawing):
        name, _, value = text.partition(": ")
        shown = value.partition(" ")[0]
        if name in measured and text not in labels:
            seen += 1
            agree([shown], pace_of(measured[name]) * measured[name]["value"])
        elif name in taped and text not in labels:
            seen += 1
            agree([shown], taped[name])
    assert seen


def test_annex(both: Outputs) -> None:
    frames = {one["frame_id"]: one["refined"] for one in both.file["frames"] if one["refined"]}
    poses = both.table("photo", "east [m]")
    (correlations,) = [r for head, r in both.tables.items() if head[1].split()[:1] == ["EN"]]
    within = {row[0]: row[1].split() for row in correlations}
    residuals = both.table("photo", "picks used")

    assert {row[0] for row in poses} == set(within) == {row[0] for row in residuals} == set(frames)
    for row in poses:
        one = frames[row[0]]
        covariance = np.array(one["covariance"])
        sigma = np.sqrt(np.diag(covariance))
        places = np.stack([one["center_world_m"], sigma[:3]], axis=1).ravel()
        agree(row[1:4], *places)
        agree(row[7:10], *np.degrees(sigma[3:]))
        found = (covariance / np.outer(sigma, sigma))[np.triu_indices(6, 1)]
        agree(within[row[0]], *found)
    used = ("used", "suspect")
    for name, count, right, down, largest, label in residuals:
        picks = [p for p in both.file["picks"] if p["image"] == name and p["status"] in used]
        agree([count], len(picks))
        if not picks:
            continue
        off = np.array([pick["residual_px"] for pick in picks])
        size = np.linalg.norm(off, axis=1)
        agree([right, down, largest], *np.sqrt((off**2).mean(axis=0)), size.max())
        assert label == picks[int(size.argmax())]["label"]


def test_correlations_of_the_annex(both: Outputs) -> None:
    known = both.file["orientation"]
    heads = [head for head in both.tables if len(head) == 2 and head[1].startswith("      fx")]
    if known is None:
        assert not heads
        return
    photos = dict(zip(known["frame_id"], known["with_pose"], strict=True))

    assert {head[0] for head in heads} - {""} <= set(photos)
    for head in heads:
        wanted = photos[head[0]] if head[0] else known["shared"]
        assert len(both.tables[head]) == len(wanted)
        for row, values in zip(both.tables[head], wanted, strict=True):
            agree(row[1].split(), *values)
            assert row[1].split().count("–") == values.count(None)


def test_error_budget(both: Outputs) -> None:
    budget = both.file.get("error_budget")
    if budget is None:
        assert not both.table("name", "share of the variance")
        return
    (rows,) = [r for head, r in both.tables.items() if "share of the variance" in head]
    sources = [name for _, name in sorted(both.numbered(budget["sources"]))]
    shares = {
        one["name"]: dict(zip(budget["sources"], row, strict=True))
        for one, row in zip(both.file["measurements"], budget["shares"], strict=True)
        if None not in row
    }

    assert sorted(sources) == sorted(budget["sources"])
    assert {row[0] for row in rows} == set(shares)
    for row in rows:
        share = shares[row[0]]
        agree(row[3].split(), *(100 * share[source] for source in sources))
        assert row[2] == max(share, key=lambda source: share[source])


def test_known_lengths(both: Outputs) -> None:
    rows = {row[0]: row for row in both.table("name and ends")}
    lines = {
        f"{one['name']}{one['from']} – {one['to']}": one
        for one in both.file["lines"]
        if one["status"] != "checked"
    }

    assert set(rows) == set(lines)
    for name, one in lines.items():
        keys: tuple[str, ...] = (
            "length_m",
            "sigma_m",
            "adjusted_m",
            "adjusted_sigma_m",
            "residual_m",
            "w",
        )
        keys += ("redundancy", "mdb_m")
        agree(rows[name][1:7], *(one[key] for key in keys))
        if one.get("external_on"):
            agree([rows[name][7].partition(" in ")[0].rstrip("²")], one["external"])


def test_checks(both: Outputs) -> None:
    lengths = {row[0]: row for row in both.table("withheld length")}
    points = {row[0]: row for row in both.table("check point")}
    lines = {one["name"]: one for one in both.file["lines"]}

    assert len(lengths) + len(points) == len(both.file["checks"])
    for one in both.file["checks"]:
        if "label" in one:
            axes = zip(one["error_m"], one["sigma_m"], strict=True)
            agree(
                points[one["label"]][1:5],
                *(part for axis in axes for part in axis),
                one["mahalanobis"],
            )
        else:
            line = lines[one["name"]]
            cells = lengths[f"{line['name']}{line['from']} – {line['to']}"]
            keys: tuple[str, ...] = ("length_m", "sigma_m", "adjusted_m", "adjusted_sigma_m")
            agree(cells[1:5], *(line[k] for k in keys), one["error_m"], one["sigma_m"], one["z"])


def test_points(both: Outputs) -> None:
    rows = {row[0]: row for row in both.table("label", "east, north, up [m]")}
    nowhere = both.file["world"]["gauge"] == "plane"

    for one in both.file["points"]:
        within, earth = one["relative"]["ellipse_95"], one["ellipse_95"]
        cells = rows[one["label"]].copy()
        if nowhere:
            cells.insert(2, "–")  # no latitude and longitude
        agree(cells[1:3], *one["position_world_m"], one["latitude_deg"], one["longitude_deg"])
        if (sigma_m := one["neighbour_sigma_m"]) is None:
            assert cells[3] == "–"
        else:
            agree(cells[3:4], sigma_m * (100 if cells[3].endswith("cm") else 1))
        axes = []
        for ellipse, cell in ((within, cells[4]), (earth, cells[6])):
            for key, text in zip(("semi_major_m", "semi_minor_m"), cell.split(" × "), strict=True):
                axes.append((text, ellipse[key] * (100 if text.endswith("cm") else 1)))
        for text, value in axes:
            agree([text], value)
        agree(cells[5:6], within["azimuth_deg"])
        agree(cells[7:8], len(one["frames"]))


def test_fit(both: Outputs) -> None:
    solution = both.file["solution"]
    rows = both.table("observations", "how many")

    agree(rows[0][2:4], solution["degrees_of_freedom"], solution["variance_factor"])
    assert len(rows) == 1 + len(solution["groups"])
    for row, group in zip(rows[1:], solution["groups"], strict=True):
        agree(row[1:4], group["observations"], group["redundancy"], group["variance_factor"])


def test_alternatives(both: Outputs) -> None:
    rows = both.table("name", "in this result")
    measured = {one["name"]: i for i, one in enumerate(both.file["measurements"])}

    assert bool(rows) == bool(both.file["solution"]["alternatives"])
    for row in rows:
        i = measured[row[0]]
        here = both.file["measurements"][i]["value"]
        (other,) = both.file["solution"]["alternatives"]
        there = other["values"][i]
        sigma = both.file["measurements"][i]["sigma"]
        pace = pace_of(both.file["measurements"][i])
        sizes = (here, there, there - here)
        agree(row[1:5], *(pace * size for size in sizes), abs(there - here) / sigma)


def test_areas_and_camera(both: Outputs) -> None:
    areas = both.table("area", "height [m]")
    lens = both.file["shared"]["intrinsics"]

    for row, area in zip(areas, both.file["areas"] if areas else [], strict=True):
        height, slope = area["height_m"], area["slope_deg"]
        slopes = [x for pair in zip(slope["value"], slope["sigma"], strict=True) for x in pair]
        agree(row[1:], height["value"], height["sigma"], *slopes, *area["pivot_m"])
    rows = both.table("parameter")
    keys = ("prior_value", "prior_sigma", "value", "sigma", "sigma_ratio", "shift_prior_sigmas")
    assert [row[0] for row in rows] == lens["names"]
    for k, row in enumerate(rows):
        agree(row[1:5], *(lens[key][k] for key in keys))


def test_photos(both: Outputs) -> None:
    rows = {row[0]: row for row in both.table("photo", "exposure (UTC)")}
    counts = Counter(one["image"] for one in both.file["picks"])

    assert set(rows) == {one["frame_id"] for one in both.file["frames"]}
    for one in both.file["frames"]:
        cells = rows[one["frame_id"]]
        agree(cells[3:4], counts[one["frame_id"]])
        if one["refined"] is None:
            assert cells[4:7] == ["–"] * 3
            continue
        sigma = np.sqrt(np.diag(one["refined"]["covariance"]))
        height = one["refined"]["center_world_m"][2]
        agree(cells[4:7], height, sigma[:3].max(), np.degrees(sigma[3:].max()))


def test_what_was_found_along(both: Outputs) -> None:
    rows = {
        cells[0]: cells[1]
        for head, found in both.tables.items()
        for cells in (head, *found)
        if len(cells) == 2
    }
    shared, clock = both.file["shared"], both.file["clock"] or {}
    plane = shared["plane"]
    words = {
        "camera clock minus UTC [s]": clock.get("offset_s") is not None
        and {"value": [clock["offset_s"]], "sigma": [clock["sigma_s"]]},
        "position of the log minus truth: east, north, up [m]": shared["position_bias_m"],
        "heading of the log minus truth [°]": shared["heading_bias_deg"],
        "camera against its mount: rotation vector [°]": shared["boresight_deg"],
        "autopilot to camera, in the vehicle's axes [m]": shared["lever_arm_m"],
        "height of the ground plane [m]": len(both.file["areas"]) < 2 and plane["height_m"],
        "slope of the ground to the east, to the north [°]": len(both.file["areas"]) < 2
        and plane["slope_deg"],
    }

    for name, one in words.items():
        assert (name in rows) == bool(one), name
        if one:
            values, sigmas = np.atleast_1d(one["value"]), np.atleast_1d(one["sigma"])
            agree([rows[name]], *np.stack([values, sigmas], axis=1).ravel())


def test_undetected_errors(both: Outputs) -> None:
    rows = {row[0]: row for row in both.table("name", "weakest link")}
    links = {one["name"]: one["weakest"] for one in both.file["measurements"] if "weakest" in one}

    assert set(rows) == set(links)
    for name, link in links.items():
        found = AMOUNT.match(rows[name][1])
        assert found is not None
        assert found["what"] == link["what"]
        assert float(found["bias"]) == pytest.approx(link["mdb"], rel=5e-3)
        agree([found["change"]], abs(link["change"]))


def test_priors(both: Outputs) -> None:
    priors = both.file.get("priors") or []
    rows = both.table("what", "photo", "moved by [its sigmas]")
    worst = sorted(priors, key=lambda one: -abs(one["w"] or 0.0))[: len(rows)]

    assert len(rows) == min(len(priors), 20)
    for row, one in zip(rows, worst, strict=True):
        assert row[1] == (one["frame_id"] or "–")
        agree(row[2:5], one["residual_sigmas"], one["w"], one["redundancy"])
        if one["external_on"]:
            assert row[6].endswith(f"in {one['external_on']!r}")
            agree([row[6].partition(" in ")[0].rstrip("²")], one["external"])


def test_picks_that_do_not_fit(both: Outputs) -> None:
    rows = {(row[0], row[1]): row for row in both.table("point", "photo")}
    bad = [one for one in both.file["picks"] if one["status"] in ("suspect", "removed")]

    assert set(rows) == {(one["label"], one["image"]) for one in bad}
    for one in bad:
        cells = rows[one["label"], one["image"]]
        agree(cells[2:5], *one["residual_px"], one["w"], one["redundancy"])


def test_inputs(both: Outputs) -> None:
    rows = both.table("input", "bytes")

    assert {row[0]: row[1:] for row in rows} == {
        path: [str(one["bytes"]), one["sha256"]]
        for path, one in both.file["provenance"]["inputs"].items()
    }


def test_an_unlike_number_is_noticed() -> None:
    with pytest.raises(AssertionError):
        agree(["12.35 ± 0.02 m"], 12.356, 0.02)
    with pytest.raises(AssertionError):
        agree(["12.35 ± 0.02 m"], 12.35)
