"""Numbers and names that the formulas of the method section need."""

from __future__ import annotations

from uavgram.estimation.reliability.redundancy import (
    TEST_POWER,
    compute_critical_value,
    compute_noncentrality,
)
from uavgram.geometry.ground.ellipse import ELLIPSE_95
from uavgram.model.result.result import Result
from uavgram.views.survey.limits import significance_of
from uavgram.views.formatting import number


def method_facts(result: Result) -> dict[str, str | bool]:
    """Return the values for the section on the method, by their names in the template.

    The lens is ``brown``, ``rational`` or ``fisheye``; a log may be photo poses; the ellipse is in
    sigmas; the rest belongs to the tests of single observations.
    """
    camera, significance = result.camera, significance_of(result)
    rational = camera.model == "brown" and len(camera.parameters) > 9
    return {
        "lens": "rational" if rational else camera.model,
        "has_log": bool(result.has_seed.any()),
        "has_heights": bool(result.points.is_off_ground.any()),
        "has_skid": "skid_speed" in result.measurements.kind,
        "has_volume": "volume" in result.measurements.kind,
        "ellipse": number(ELLIPSE_95, 4),
        "significance": f"{significance:g}",
        "critical": number(compute_critical_value(significance), 2),
        "noncentrality": number(compute_noncentrality(significance), 2),
        "power": f"{100 * TEST_POWER:.0f} %",
    }
