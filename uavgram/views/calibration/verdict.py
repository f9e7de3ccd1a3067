"""Verdict on a calibration, in words that need no background, and its tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from uavgram.model.board import CalibrationAccount, CalibrationResult, LensEffect, ModelScore
from uavgram.model.camera import Calibration
from uavgram.views.formatting import LEVEL_RANK, number
from uavgram.views.survey.outlines import find_largest_finite
from uavgram.views.tables import Cell, Cells, Row, Table, make_table

GOOD_FOCAL = 0.005
"""Limit of a good calibration: relative error of the focal length, or of lengths by the lens."""
WORST_SHARE = 0.05
"""Share of a length: a lens that costs more is no better than one guessed from EXIF (3 to 8 %)."""

_UNDETERMINED = (
    "The photos do not determine this lens: estimate fewer coefficients (--coefficients auto "
    "chooses), and take more photos with the board tilted to all sides and in the corners of the "
    "image."
)

Fact = tuple[str, str]


@dataclass(frozen=True)
class Verdict:
    """Verdict in one sentence, with its reasons.

    Attributes
    ----------
    level
        ``good``, or ``look`` (something deserves a second look).
    sentence
        Headline of the page.
    reasons
        Points to check, worst first; empty if all is good.
    counts
        Number of photos and corners that were used, in one sentence.
    """

    level: Literal["good", "look"]
    sentence: str
    reasons: tuple[str, ...]
    counts: str


def judge_calibration(account: CalibrationAccount) -> Verdict:
    """Summarise a calibration in one verdict."""
    result = account.result
    ordered = sorted(account.messages, key=lambda message: LEVEL_RANK[message.level])
    reasons = tuple(message.text for message in ordered if message.level != "info")
    share = focal_share(result.calibration)
    known = f"the focal length is known to {100 * share:.2g} %"
    counts = _counts(account)
    if not result.quality.converged:
        return Verdict("look", "Not usable: the adjustment did not converge.", reasons, counts)
    cost = length_share(account.effects)
    if not cost <= WORST_SHARE:
        reasons = (_UNDETERMINED, *reasons)
        return Verdict("look", f"Not usable: {_cost(cost)}.", reasons, counts)
    if cost > GOOD_FOCAL and cost > share:
        return Verdict("look", f"Use with care: {_cost(cost)}.", reasons, counts)
    if share > GOOD_FOCAL:
        return Verdict("look", f"Use with care: {known} only.", reasons, counts)
    if reasons:
        sentence = f"Usable where the board was seen: {known}. Look at this:"
        return Verdict("look", sentence, reasons, counts)
    return Verdict("good", f"Good: {known}, and there are no warnings.", (), counts)


def length_share(effects: tuple[LensEffect, ...]) -> float:
    """Return the relative error of a usual length straight down due to the lens alone.

    It is the larger of two: with the pose from known lengths, and from the flight log. NaN if the
    camera sees no ground.
    """
    lengths = effects[0].lengths
    return float("nan") if lengths is None else max(lengths.medians)


def _cost(share: float) -> str:
    if np.isnan(share):
        return "the lens model gives hardly any pixel a direction"
    return f"the lens alone costs a length {percent(share)}"


def focal_share(camera: Calibration) -> float:
    """Return the relative standard deviation of the worse of fx and fy."""
    sigma = np.sqrt(np.diag(camera.covariance))
    return float((sigma[:2] / camera.parameters[:2]).max())


def _counts(account: CalibrationAccount) -> str:
    photos, corners = account.result.photos, account.result.corners
    used = sum(status != "removed" for status in photos.status)
    total = len(photos.file) + len(account.left_out)
    kept = sum(status != "removed" for status in corners.status)
    return f"{used} of {total} photos and {kept} of {len(corners.status)} corners were used."


def calibration_facts(account: CalibrationAccount) -> tuple[Fact, ...]:
    """List the main facts as pairs of question and answer."""
    result = account.result
    camera, quality = result.calibration, result.quality
    sigma = np.sqrt(np.diag(camera.covariance))
    fx, fy, cx, cy = camera.parameters[:4]
    held = pixels_text(np.nan if quality.held_out_px is None else quality.held_out_px)
    return (
        ("focal length", f"{fx:.1f} ± {sigma[0]:.1f} and {fy:.1f} ± {sigma[1]:.1f} px"),
        ("principal point", f"{cx:.1f} ± {sigma[2]:.1f}, {cy:.1f} ± {sigma[3]:.1f} px"),
        ("error of the lens model in a photo left out", f"{held} px per coordinate"),
        ("a corner is measured to", f"{pixels_text(quality.sigma_px)} px per coordinate"),
        ("a direction is known to", _direction(result)),
        *_length_facts(account.effects),
    )


def _direction(result: CalibrationResult) -> str:
    values = result.maps.uncertainty_px
    rows, columns = values.shape
    middle = values[rows // 4 : rows - rows // 4, columns // 4 : columns - columns // 4]
    return (
        f"{pixels_text(find_largest_finite(middle))} px in the middle half of the image, "
        f"{pixels_text(find_largest_finite(values))} px at worst"
    )


def _length_facts(effects: tuple[LensEffect, ...]) -> tuple[Fact, ...]:
    """Describe the error of lengths for the first pose, looking straight down."""
    lengths = effects[0].lengths
    if lengths is None:
        return ()
    fitted, known = lengths.medians
    text = (
        f"{percent(fitted)} (pose from known lengths), {percent(known)} (pose from the flight log)"
    )
    return (("the lens alone costs a length, straight down (median)", text),)


def percent(share: float) -> str:
    """Format a share in percent with two significant digits: ``0.032 %``."""
    return f"{100 * share:.2g} %" if share < 0.1 else f"{100 * share:.0f} %"


def pixels_text(value: float) -> str:
    """Format pixels with two significant digits: ``0.18``, ``2.4``, ``25``; en dash for NaN."""
    if not np.isfinite(value):
        return "–"
    if value >= 9.95:
        return f"{value:.0f}"
    return f"{value:.1f}" if value >= 0.995 else f"{value:.2f}"


def message_table(account: CalibrationAccount) -> Table:
    """Return the messages, the worst first."""
    ordered = sorted(account.messages, key=lambda message: LEVEL_RANK[message.level])
    rows = (
        Row((Cell(one.level, look="tag"), one.text, Cell(one.code, look="mono")),
            one.level == "error")
        for one in ordered
    )  # fmt: skip
    return make_table(" |  | ", rows)


def parameter_table(calibration: Calibration) -> Table:
    """Return parameter, value, sigma, and relative sigma of fx and fy."""
    rows = []
    sigma = np.sqrt(calibration.covariance.diagonal())
    for name, value, error in zip(
        calibration.parameter_names, calibration.parameters.tolist(), sigma.tolist(), strict=True
    ):
        share = f"{100 * error / value:.3f} %" if name in {"fx", "fy"} else "–"
        rows.append(
            (name, _parameter(name, value), _parameter(name, error) if error else "held", share)
        )
    return make_table("parameter | *value | >1 sigma | >sigma/value", rows)


def _parameter(name: str, value: float) -> str:
    return f"{value:.3f} px" if name in {"fx", "fy", "cx", "cy"} else f"{value:.6f}"


def model_table(result: CalibrationResult) -> Table:
    """Return the lens models that were compared; criteria are differences from the best."""
    scores = [(model.aic, model.bic) for model in result.models]
    best = [
        min((one for one in own if one is not None), default=0.0)
        for own in zip(*scores, strict=True)
    ]
    rows: list[Cells] = [
        (
            str(model.coefficients),
            _held(model),
            *(
                "–" if one is None else number(one - least, 1)
                for one, least in zip(own, best, strict=True)
            ),
            Cell("taken" if model.is_chosen else "", look="tag"),
        )
        for model, own in zip(result.models, scores, strict=True)
    ]
    return make_table(
        "distortion coefficients | >error in photos left out | >Akaike | >Bayes | ", rows
    )


def _held(model: ModelScore) -> str:
    if model.dropped:
        return f"no choice: {model.dropped}"
    known = model.held_out_px is not None
    return f"{model.held_out_px:.3f} px" if known else "cannot do without one of them"


def odd_corners(result: CalibrationResult, photo: int | None = None) -> Table:
    """Return the corners that fit worse than chance allows, worst first.

    Parameters
    ----------
    result
        The calibration.
    photo
        Row of the only photo; None: of all that were used.
    """
    corners, photos = result.corners, result.photos
    size = np.linalg.norm(corners.residual_px, axis=1)
    rows = [
        i
        for i in np.argsort(-corners.w, kind="stable").tolist()
        if corners.status[i] != "used"
        and (
            corners.photo[i] == photo
            if photo is not None
            else photos.status[int(corners.photo[i])] != "removed"
        )
    ]
    cells = (
        (
            photos.file[int(corners.photo[i])],
            str(int(corners.corner[i])),
            f"{corners.pixel_px[i, 0]:.1f}, {corners.pixel_px[i, 1]:.1f}",
            f"{pixels_text(float(size[i]))} px",
            corners.status[i],
        )
        for i in rows
    )
    return make_table("photo | >corner | >at [px] | >residual | status", cells)
