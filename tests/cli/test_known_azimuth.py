"""A known azimuth has all that other known things have: residual, test, report, messages."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import norm
from small_projects import Project

import uavgram


def with_azimuth(project: Project, error: float, sigma: float = 0.2) -> float:
    """Give the project the azimuth of two of its points, and return the true one."""
    points = json.loads((project / "truth.json").read_text())["points"]
    ahead = np.subtract(points["R3"], points["R1"])
    true = float(np.degrees(np.arctan2(ahead[0], ahead[1])) % 360.0)
    text = f"name,kind,points,value,sigma\nwall,azimuth,R1;R3,{true + error:.6f},{sigma}\n"
    (project / "known.csv").write_text(text)
    project.set(known="known.csv")
    return true


def test_it_is_tested_and_reported_like_all_known_things(project: Project) -> None:
    true = with_azimuth(project, 0.0)
    result = uavgram.run(project.path)
    known = result.known
    report = "".join((project.out / f"report{part}.html").read_text() for part in ("", "-annex"))

    assert (known.kind, known.unit, known.status) == (("azimuth",), ("deg",), ("used",))
    assert known.adjusted[0] == pytest.approx(true, abs=4 * known.adjusted_sigma[0])
    # One number: w = v / (sigma sqrt(r)), and the bias that is found with 80 % (Baarda 1968).
    redundancy = 1.0 - (known.adjusted_sigma[0] / 0.2) ** 2
    assert known.redundancy[0] == pytest.approx(redundancy, rel=1e-6)
    w = known.residual[0] / (0.2 * np.sqrt(redundancy))
    assert known.w[0] == pytest.approx(w, rel=1e-6)
    detectable = 0.2 * (norm.isf(0.0005) + norm.ppf(0.8)) / np.sqrt(redundancy)
    assert known.mdb[0] == pytest.approx(detectable, rel=1e-6)
    assert "azimuth" in report


def test_a_wrong_one_is_named(project: Project) -> None:
    with_azimuth(project, 6.0)
    result = uavgram.run(project.path, output=None)
    texts = [one.text for one in result.messages if one.code.startswith("known-")]

    assert result.known.status[0] in ("suspect", "removed")
    assert any("azimuth 'wall' ('R1', 'R3')" in text for text in texts)


def test_without_a_world_it_is_idle(project: Project) -> None:
    with_azimuth(project, 0.0)
    project.set(log=None)
    result = uavgram.run(project.path, output=None)
    (message,) = (one for one in result.messages if one.code == "known-idle")

    assert result.known.status == ("idle",)
    assert "nothing else determines where north is. It takes the flight log" in message.text
