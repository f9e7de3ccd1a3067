"""A plan on the terminal: what other choices would bring, and what of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from planned_sample import bare_plan, sample_plan

from uavgram.model.planned import ChosenBy, Gain
from uavgram.views.flight_plan_text import plan_lines

PLAN = sample_plan()


def told(gain: Gain, worst: float) -> list[str]:
    without = np.full(len(PLAN.lines.name), 0.02)
    without[1] = worst
    lines = replace(PLAN.lines, mean_sigma_without=without)
    return plan_lines(replace(PLAN, lines=lines, mean_sigma=0.02, gains=(gain,)))


def test_a_layout_that_bears_a_loss_tells_what_it_bears() -> None:
    gain = Gain(what="5 lines laid to bear a loss best", mean_sigma=0.021, worst_without=0.03)
    assert (
        "  5 lines laid to bear a loss best: ± 2.1 cm, 5 % worse; with its most important line "
        "lost ± 3.0 cm, where in this plan ± 4.3 cm"
    ) in told(gain, 0.043)
    held = [line for line in told(gain, np.nan) if "bear a loss" in line]
    assert held[0].endswith("± 3.0 cm, where in this plan there would be no scale")


def test_the_mean_says_what_it_is_of() -> None:
    """The sample measures an area too, which no mean of metres holds."""
    assert "On average of the lengths expect ± 2.0 cm. Other choices:" in told(
        Gain(what="one more line", mean_sigma=0.02), 0.03
    )
    kinds = replace(PLAN.measurements, unit=("m",) * 4)
    shown = plan_lines(replace(PLAN, measurements=kinds))
    assert any(line.startswith("On average expect") for line in shown)


def test_what_the_lines_were_chosen_for_is_told() -> None:
    def shown(by: ChosenBy, *, wished: bool = True) -> str:
        wanted = PLAN.measurements.wanted_sigma if wished else np.full(4, np.nan)
        measured = replace(PLAN.measurements, wanted_sigma=wanted)
        return "\n".join(plan_lines(replace(PLAN, chosen_by=by, measurements=measured)))

    assert "The lines lie where the average ± is smallest." in shown("mean")
    assert "each is compared with the ± you wish" in shown("shares")
    assert "plain one of the lengths" in shown("shares")
    assert "each is compared with its usual ±" in shown("shares", wished=False)
    assert "lie where" not in "\n".join(plan_lines(bare_plan()))
