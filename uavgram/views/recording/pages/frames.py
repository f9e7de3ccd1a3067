"""A sheet of text for every frame."""

from __future__ import annotations

import numpy as np

from uavgram.model.result.result import Result
from uavgram.views.recording.curves.plots import Curves
from uavgram.views.recording.curves.pose_curves import PoseCurves
from uavgram.views.markdown import plain
from uavgram.views.recording.photo.frame_picks import FramePicks
from uavgram.views.wording import FRAME_STATUS_WORDS, utc


def frame_sheet(
    result: Result, picks: FramePicks, curves: Curves, poses: PoseCurves, frame: int
) -> str:
    """What there is to know of one frame."""
    frames, rows = result.frames, picks.rows[frame]
    status = FRAME_STATUS_WORDS[frames.status[frame]]
    lines = [
        f"# {plain(frames.frame_id[frame])}: {status}",
        plain(frames.reason[frame]),
        f"- exposure (UTC): {utc(float(frames.time_utc_s[frame]))}",
        f"- picks: {len(rows)}",
    ]
    if np.isfinite(curves.refined_rms_px[frame]):
        lines.append(f"- residuals: {curves.refined_rms_px[frame]:.2f} px refined")
    if np.isfinite(curves.seed_rms_px[frame]):
        lines.append(f"- residuals: {curves.seed_rms_px[frame]:.1f} px from the flight log alone")
    if result.has_refined[frame]:
        center = frames.refined.center_world_m[frame]
        sigma = np.sqrt(np.diagonal(frames.refined.covariance[frame]))
        position = ", ".join(f"{c:.2f} ± {s:.2f}" for c, s in zip(center, sigma[:3], strict=True))
        lines.append(f"- position east, north, up [m]: {position}")
        lines.append(f"- attitude sigma [°]: {np.degrees(sigma[3:].max()):.2f}")
        if result.has_seed[frame]:
            moved = np.linalg.norm(center - frames.seed.center_world_m[frame])
            lines.append(
                f"- corrected against the flight log: moved by {moved:.2f} m, tilted by "
                f"{poses.tilt_deg[frame]:.2f}°, turned by {poses.turn_deg[frame]:.2f}°"
            )
    w = np.nan_to_num(np.abs(result.picks.w[rows]))
    if len(rows) and w.max() > 0:
        worst = rows[int(np.argmax(w))]
        lines.append(f"- worst pick: {plain(result.picks.label[worst])} (w = {w.max():.1f})")
    return "\n\n".join(line for line in lines[:2] if line) + "\n\n" + "\n".join(lines[2:])
