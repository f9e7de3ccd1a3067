"""Does the program name the cause of a misfit, and can its verdict be trusted?

Makes surveys in which one thing is wrong (`tests/support/hostile_causes.py`), and runs each as a
user would; then at the stated noise with nothing left out, learnt or mended (untreated), and
without the fault. One line for each cause, and one for all of them:

    z        root mean square of error over sigma; with `--mode remove` after what was mended
    raw z    median of the untreated one
    due      surveys whose untreated z is above 2, and in which the cause can show at all
    first    of those: the cause is said first and rightly, or told by a learnt value, per cent
    exact    of those: by the code that says most, per cent
    any      of those: it is named rightly anywhere, per cent
    tape     what is said first blames a length that is right, per cent of all
    red amber green  of the verdict, per cent of all
    wrongly  green though z is above 2: surveys, of those whose z is and whose cause can show
    mended   just that was mended which is wrong, per cent of those that `remove` is to mend
    cpu, x   seconds for one survey, reading and computing; over that without the fault

    python tests/benchmarks/study_causes.py labels_swapped length_in_feet --surveys 8 --seed 3000
    python tests/benchmarks/study_causes.py --mode remove --workers 2 --json /tmp/causes.json
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from cause_outcomes import REMOVED, Outcome, run_case
from hostile_causes import CASES

from uavgram.pipeline.threads import limit_blas_threads

BAD_Z = 2.0
LEVELS = ("red", "amber", "green")
HEADS = (
    *("z", "raw z", "due", "first", "exact", "any", "tape", *LEVELS, "wrongly"),
    *("mended", "cpu", "x"),
)


@limit_blas_threads
def judged(
    job: tuple[str, int], options: Mapping[str, object], *, compared: bool, dense: bool
) -> Outcome:
    """`run_case` in one thread."""
    return run_case(job, options, compared=compared, dense=dense)


def row(outcomes: Sequence[Outcome]) -> str:
    """The table's line of some surveys."""
    good = [one for one in outcomes if not one.failure]
    if not good:
        return f"all {len(outcomes)} failed: {outcomes[0].failure[:90]}"
    due = [one for one in outcomes if is_due(one)]
    bad = [one for one in good if one.tellable and one.z > BAD_Z]
    z = np.sqrt(np.nanmean([one.z**2 for one in good]))
    times = np.mean([one.cpu_s / one.clean_cpu_s for one in good])  # NaN with --alone
    levels = " ".join(percent([one.level == level for one in good]) for level in LEVELS)
    return (
        f"{z:7.2f} {np.median([one.untreated_z for one in outcomes]):7.2f} {len(due):7d} "
        f"{percent([one.named for one in due])} {percent([one.exactly for one in due])} "
        f"{percent([one.anywhere or one.learnt for one in due])} "
        f"{percent([one.accused for one in outcomes])} {levels} "
        f"{sum(one.level == 'green' for one in bad):3d}/{len(bad):3d} "
        f"{percent([one.repaired for one in outcomes if CASES[one.case].mended])} "
        f"{np.mean([one.cpu_s for one in good]):7.2f} {times:7.1f}"
    )


def is_due(one: Outcome) -> bool:
    """Whether the cause matters and shows."""
    return CASES[one.case].has_cause and one.tellable and one.untreated_z > BAD_Z


def percent(holds: Sequence[bool]) -> str:
    """Share in a column of the table."""
    return f"{100 * np.mean(holds):7.0f}" if holds else f"{'-':>7s}"


def firsts(outcomes: Sequence[Outcome]) -> str:
    """What is said first, the commonest of it, with the number of surveys; failures too."""
    count = Counter(
        one.failure[:60] or next((told.code for told in one.told), "nothing") for one in outcomes
    )
    return ", ".join(f"{code} {number}" for code, number in count.most_common(5))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", nargs="*", choices=[[], *CASES])
    parser.add_argument("--surveys", type=int, default=8)
    parser.add_argument("--seed", type=int, default=3000, help="of the first survey")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--mode", choices=["report", "remove"], default="report")
    parser.add_argument("--alone", action="store_true", help="no untreated run, none without fault")
    parser.add_argument("--dense", action="store_true", help="labels are picked wherever seen")
    parser.add_argument("--option", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--json", type=Path, help="every outcome, to look closer")
    parser.add_argument("--each", action="store_true", help="a line for each survey too")
    given = parser.parse_args()
    options = {key: yaml.safe_load(value) for key, value in (o.split("=", 1) for o in given.option)}
    options |= REMOVED if given.mode == "remove" else {}
    run = partial(judged, options=options, compared=not given.alone, dense=given.dense)
    print(f"{'':38s}" + " ".join(f"{head:>7s}" for head in HEADS))
    everything: list[Outcome] = []
    with ProcessPoolExecutor(given.workers) as pool:
        for name in given.case or list(CASES):
            jobs = [(name, given.seed + k) for k in range(given.surveys)]
            outcomes = list(pool.map(run, jobs))
            print(f"{name:38s}{row(outcomes)}   {firsts(outcomes)}", flush=True)
            for one in outcomes if given.each else ():
                code = next((told.code for told in one.told), "nothing")
                print(f"  {one.seed:6d} z {one.z:6.2f} raw {one.untreated_z:7.2f} {code}")
            everything += outcomes
    promised = [one for one in everything if CASES[one.case].must]
    well = [one for one in everything if not CASES[one.case].has_cause]
    for name, some in (("all", everything), ("promised", promised), ("nothing wrong", well)):
        if some:
            print(f"{name + f' ({len(some)})':38s}{row(some)}   {firsts(some)}")
    if well:
        red, misfits = sum(one.level == "red" for one in well), sum(one.misfits for one in well)
        print(f"of {len(well)} with nothing wrong {red} red, {misfits} amber or red for a misfit")
    if given.json:
        given.json.write_text(json.dumps([asdict(one) for one in everything]))


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
