"""Ways to find the pose of one photo, compared: points, lines of known position, lengths, a log.

    python tests/benchmarks/study_methods.py --scenes 1000 --poselib

Level ground, a photo of 12 MP from 40 m, tilted by 0 to 60 degrees; 4 to 8 lines of 3 to 15 m,
whose ends are picked to 0.8 px, taped and surveyed to 1 cm. Judged are twelve other distances.
Then the limits of points and lines; and how often lines reach the best minimum.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from poselib_lines import p3ll_starts, pnpl_starts

from uavgram.model.simulation import MethodRow
from uavgram.synthetic.pose_methods import (
    LIMIT_SETTINGS,
    LINES,
    MAX_RIVAL_INCREASE,
    compare_methods,
    compute_rival_differences,
    find_direct_starts,
    find_line_starts,
    find_minima,
)
from uavgram.synthetic.single_photos import Setting, draw_scenes

SAME = 1e-2
"""Sums of squares closer than this are of one minimum."""


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--poselib", action="store_true", help="PoseLib's starts for lines, too")
    parser.add_argument("--limits", action="store_true", help="where points and lines end")
    arguments = parser.parse_args()
    began = time.process_time()
    usual = Setting(name="usual")
    more = {"lines, PoseLib p3ll": p3ll_starts} if arguments.poselib else {}
    shown(compare_methods(usual, arguments.scenes, arguments.seed, more))
    if arguments.limits:
        for setting in LIMIT_SETTINGS:
            shown(compare_methods(setting, arguments.scenes, arguments.seed))
    reached(arguments.scenes, arguments.seed, poselib=arguments.poselib)
    print(f"{time.process_time() - began:.1f} s of CPU")


def shown(rows: list[MethodRow]) -> None:
    """Print one table; errors in millimetres, shares in per cent."""
    print(
        f"\n{rows[0].setting}, {rows[0].scenes} scenes\n{'method':28}{'rms':>8}{'90th':>8}"
        f"{'fewest':>8}{'most':>8}{'failed':>8}{'told':>7}{'silent':>8}{'95 %':>7}{'z':>7}"
    )
    for row in rows:
        lengths = (row.rms_m, row.ninth_m, row.fewest_m, row.most_m)
        print(
            f"{row.method:28}{''.join(f'{1e3 * one:8.0f}' for one in lengths)}"
            f"{100 * row.failed:8.1f}{100 * row.told:7.1f}{100 * row.failed_silently:8.1f}"
            f"{100 * row.coverage:7.1f}{min(row.z, 999.0):7.2f}"
        )


def reached(scenes: int, seed: int, *, poselib: bool) -> None:
    """Share of scenes with four lines in which each way to begin leads to the best minimum."""
    drawn = draw_scenes(Setting(name="four lines"), 4, scenes, seed)
    ends = {
        "direct": find_minima(drawn, LINES, find_direct_starts(drawn)),
        "search": find_minima(drawn, LINES, find_line_starts(drawn)),
        "truth": find_minima(drawn, LINES, (drawn.center[:, None], drawn.rotation[:, None])),
    }
    if poselib:
        ends["PoseLib p3ll"] = find_minima(drawn, LINES, p3ll_starts(drawn))
        starts, below = pnpl_starts(drawn)
        ends["PoseLib pnpl"] = find_minima(drawn, LINES, starts)
        print(f"\nposes of PoseLib's pnpl below ground: {100 * below.mean():.1f} %")
    best = np.min([end.cost[:, 0] for end in ends.values()], axis=0)
    print("\nfour lines: share that reaches the best minimum")
    for name, end in ends.items():
        print(f"{name:16}{100 * np.mean(end.cost[:, 0] <= best + SAME):7.2f} %")
    told = np.isfinite(compute_rival_differences(ends["search"], MAX_RIVAL_INCREASE))
    right = ends["search"].cost[:, 0] <= best + SAME
    either = 100 * np.mean(right | told)
    print(f"search: reached or told {either:.2f} %, told {100 * told.mean():.2f} %")


if __name__ == "__main__":
    main()
