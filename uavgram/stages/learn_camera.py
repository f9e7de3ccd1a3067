"""Self-calibration in flight, in words: what the survey says of its camera, and what it cannot."""

from __future__ import annotations

import numpy as np

from uavgram.model.learnt_camera import LEARNT_BELOW, LearntCamera
from uavgram.model.message import Message

FAR = 3.0
"""Prior sigmas beyond which a parameter's shift contradicts the calibration."""

_PIXELS = {"fx", "fy", "cx", "cy"}


def what_was_learnt(camera: LearntCamera) -> tuple[Message, ...]:
    """Say which parameters the survey determines better than the calibration did, and which not.

    Parameters
    ----------
    camera
        Before and after.

    Returns
    -------
    One message; a second one, a warning, where the survey contradicts the calibration; none where
    the calibration holds every parameter fixed.
    """
    if np.isnan(camera.ratio).all():
        return ()
    learnt = np.flatnonzero(camera.learnt)
    rest = [camera.names[i] for i in np.flatnonzero(~camera.learnt & ~np.isnan(camera.ratio))]
    unknown = (
        f"{' '.join(rest)} cannot be learnt from it (their sigmas stay within "
        f"{100 * (1 - LEARNT_BELOW):.0f} % of the calibration's)"
    )
    if not learnt.size:
        text = f"The survey's own picks and lengths say nothing new of the camera: {unknown}."
        return (Message("info", "camera-not-learnt", text),)
    refined = ", ".join(_refined(camera, int(i)) for i in learnt)
    text = f"The survey's own picks and lengths refined the camera: {refined}" + (
        f"; {unknown}." if rest else "."
    )
    messages = [Message("info", "camera-learnt", text)]
    far = [int(i) for i in learnt if abs(camera.shift[i]) > FAR]
    if far:
        moved = ", ".join(f"{camera.names[i]} by {camera.shift[i]:+.1f}" for i in far)
        text = (
            f"The survey moves the camera farther than its calibration allows ({moved} of its "
            "sigmas): another camera, resolution, zoom or focus than was calibrated, or gross "
            "errors in picks and lengths."
        )
        messages.append(Message("warning", "camera-contradicted", text))
    return tuple(messages)


def _refined(camera: LearntCamera, i: int) -> str:
    unit = " px" if camera.names[i] in _PIXELS else ""
    before, after = camera.prior_sigma[i], camera.sigma[i]
    return (
        f"{camera.names[i]} from ± {before:.2g}{unit} to ± {after:.2g}{unit} "
        f"(moved by {camera.shift[i]:+.1f} of the calibration's sigmas)"
    )
