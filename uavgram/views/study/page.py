"""study.html: one self-contained page of all studies that were made together."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping

from uavgram.model.simulation import Cell, Study
from uavgram.views.pages import page
from uavgram.views.study.overall import overall, ranking
from uavgram.views.study.words import AGREES, said


def render_study_page(studies: tuple[Study, ...], figures: Mapping[str, bytes]) -> str:
    """Render the page as text; it loads nothing from elsewhere."""
    parts = [
        {
            "study": study,
            "said": said(study),
            "picture": b64encode(figures[f"{study.name}.svg"]).decode(),
            "rows": [_row(cell) for cell in study.cells],
        }
        for study in studies
    ]
    return page(
        "study.html",
        parts=parts,
        overall=overall(studies),
        ranking=ranking(studies) if len(studies) > 1 else [],
        seconds=sum(study.seconds for study in studies),
    )


def _row(cell: Cell) -> dict[str, object]:
    """Format a cell as texts."""
    low, high = cell.ratio_range
    return {
        "curve": cell.curve,
        "at": cell.label,
        "predicted": f"{1e3 * cell.predicted_m:.1f}",
        "simulated": f"{1e3 * cell.simulated_m:.1f}",
        "ratio": f"{cell.ratio:.3f}",
        "range": f"{low:.3f} to {high:.3f}",
        "bias": f"{1e3 * cell.bias_m:.1f}",
        "shares": [f"{100 * share:.0f}" for share in cell.shares],
        "count": f"{cell.repetitions - cell.lost} of {cell.repetitions}",
        "is_bad": low > AGREES[1] or high < AGREES[0],
    }
