"""The method: numbers and names that its formulas need."""

from __future__ import annotations

from dataclasses import dataclass

from uavgram.estimation.reliability.redundancy import POWER, critical_value, noncentrality
from uavgram.geometry.ground.ellipse import ELLIPSE_95
from uavgram.model.options import SolveOptions
from uavgram.model.result.result import Result
from uavgram.views.wording import number


@dataclass(frozen=True)
class MethodFacts:
    """What the section on the method fills in.

    Attributes
    ----------
    lens
        ``brown``, ``rational`` or ``fisheye``.
    has_log, has_skid
        Whether there is a flight log (or photo poses), and a speed from a skid.
    ellipse
        Sigmas of a 95 % ellipse.
    significance, critical, noncentrality, power
        Of the tests of single observations.
    """

    lens: str
    has_log: bool
    has_skid: bool
    ellipse: str
    significance: str
    critical: str
    noncentrality: str
    power: str


def method_facts(result: Result) -> MethodFacts:
    """Collect what the formulas need."""
    camera, options = result.camera, dict(result.provenance.options)
    stated = options.get("solve.significance")
    significance = float(stated) if isinstance(stated, float) else SolveOptions().significance
    rational = camera.model == "brown" and len(camera.parameters) > 9
    return MethodFacts(
        lens="rational" if rational else camera.model,
        has_log=bool(result.has_seed.any()),
        has_skid="skid_speed" in result.measurements.kind,
        ellipse=number(ELLIPSE_95, 4),
        significance=f"{significance:g}",
        critical=number(critical_value(significance), 2),
        noncentrality=number(noncentrality(significance), 2),
        power=f"{100 * POWER:.0f} %",
    )
