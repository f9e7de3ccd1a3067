"""Self-calibration in flight, in words: what the survey says of its camera, and what it cannot."""

from __future__ import annotations

import numpy as np

from uavgram.model.message import Message
from uavgram.model.naming import figures
from uavgram.model.result.learnt_camera import LEARNT_BELOW, LearntCamera

FAR = 3.0
"""Prior sigmas beyond which a parameter's shift contradicts the calibration."""

_PIXELS = {"fx", "fy", "cx", "cy"}


def what_was_learnt(camera: LearntCamera, *, is_assumed: bool = False) -> tuple[Message, ...]:
    """Say which parameters the survey determines better than the calibration did, and which not.

    Parameters
    ----------
    camera
        Before and after.
    is_assumed
        Whether nobody calibrated it: its values and sigmas before are a guess.

    Returns
    -------
    One message; a second one, a warning, where the survey contradicts the calibration; none where
    the calibration holds every parameter fixed.
    """
    if np.isnan(camera.ratio).all():
        return ()
    before = "assumed camera" if is_assumed else "calibration"
    learnt = np.flatnonzero(camera.learnt)
    rest = [camera.names[i] for i in np.flatnonzero(~camera.learnt & ~np.isnan(camera.ratio))]
    unknown = (
        f"{' '.join(rest)} cannot be learnt from it (their sigmas stay within "
        f"{100 * (1 - LEARNT_BELOW):.0f} % of the {before}'s)"
    )
    if not learnt.size:
        text = f"The survey's own picks and lengths say nothing new of the camera: {unknown}."
        return (Message("info", "camera-not-learnt", text),)
    refined = ", ".join(_refined(camera, int(i), before) for i in learnt)
    text = f"The survey's own picks and lengths refined the camera: {refined}" + (
        f"; {unknown}." if rest else "."
    )
    messages = [Message("info", "camera-learnt", text)]
    far = [int(i) for i in learnt if abs(camera.shift[i]) > FAR]
    if far:
        moved = ", ".join(f"{camera.names[i]} by {camera.shift[i]:+.1f}" for i in far)
        text = _contradicted(moved, is_assumed=is_assumed)
        messages.append(Message("warning", "camera-contradicted", text))
    return tuple(messages)


def _contradicted(moved: str, *, is_assumed: bool) -> str:
    if is_assumed:
        return (
            f"The survey moves the camera farther than was assumed of it ({moved} of the assumed "
            "sigmas): another kind of camera, a zoom or a cut-out, or gross errors in picks and "
            "lengths. Calibrate the camera."
        )
    return (
        f"The survey moves the camera farther than its calibration allows ({moved} of its "
        "sigmas): another camera, resolution, zoom or focus than was calibrated, or gross "
        "errors in picks and lengths. Look at these, and calibrate the camera as it was used."
    )


def _refined(camera: LearntCamera, i: int, source: str) -> str:
    unit = " px" if camera.names[i] in _PIXELS else ""
    before, after = camera.prior_sigma[i], camera.sigma[i]
    return (
        f"{camera.names[i]} from ± {figures(before)}{unit} to ± {figures(after)}{unit} "
        f"(moved by {camera.shift[i]:+.1f} of the {source}'s sigmas)"
    )
