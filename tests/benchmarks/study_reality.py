"""How honest is the program where the world is not its model?

Makes surveys with known truth under the conditions of `tests/support/hostile_conditions.py`, runs
each as a user would, and compares errors with stated sigmas. One line for each condition:

    z        root mean square of error over sigma, all measurements together; 1 is honest
    <        its one-sided 95 % bound, surveys drawn anew with replacement
    >3s      share of errors beyond three sigmas, per cent
    error    mean of |error| over the value, per cent; sigma: mean of the stated ones
    failed   surveys without a result, or without a value for some measurement
    blamed   share of surveys with a message of a code in BLAMING, per cent; named: in NAMING
    cpu      seconds for one survey, reading and computing

    python tests/benchmarks/study_reality.py clean real_mix --surveys 24 --seed 0 --workers 2
    python tests/benchmarks/study_reality.py tape_1 --option tape.scale_sigma=0.01
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from hostile_conditions import CONDITIONS
from hostile_project import tie_picks, write_project
from hostile_surveys import make_survey

from uavgram.errors import UavgramError
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.threads import limit_blas_threads

BLAMING = frozenset(
    {
        "pick-suspect",
        "pick-left-out",
        "pick-removed",
        "line-suspect",
        "line-left-out",
        "line-removed",
        "frame-left-out",
        "labels-swapped",
        "many-suspects",
        "blunder-not-located",
        "blunder-kept",
        "too-many-blunders",
        "lengths-contradict",
        "odd-height",
    }
)
"""Codes of messages that say an observation is wrong."""
NAMING = frozenset({"group-misfit", "prior-strained", "camera-contradicted", "overall-misfit"})
"""Codes of messages that say something is wrong, but no observation."""
DRAWS = 2000


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One survey: errors over sigmas, relative errors and sigmas, codes; failure is empty text."""

    condition: str
    seed: int
    z: tuple[float, ...] = ()
    error: tuple[float, ...] = ()
    sigma: tuple[float, ...] = ()
    variance_factor: float = float("nan")
    codes: tuple[str, ...] = ()
    cpu_s: float = 0.0
    failure: str = ""


@limit_blas_threads
def run_survey(job: tuple[str, int], options: Mapping[str, object]) -> Outcome:
    """Make, run and judge the survey of a condition and a seed."""
    condition, seed = job
    survey = make_survey(CONDITIONS[condition], seed)
    with TemporaryDirectory(prefix="reality") as folder:
        project = write_project(survey, Path(folder), options)
        start = time.process_time()
        try:
            inputs = read_inputs(project)
            if survey.ties is not None:
                inputs = replace(inputs, ties=tie_picks(survey))
            result = compute(inputs, curved=False).result
        except (UavgramError, np.linalg.LinAlgError) as fault:  # the latter is the program's own
            return Outcome(condition=condition, seed=seed, failure=str(fault))
        cpu_s = time.process_time() - start
    measured = result.measurements
    truth = np.array([survey.truth[name] for name in measured.name])
    error = measured.value - truth
    return Outcome(
        condition=condition,
        seed=seed,
        z=tuple((error / measured.sigma).tolist()),
        error=tuple((error / truth).tolist()),
        sigma=tuple((measured.sigma / truth).tolist()),
        variance_factor=result.solution.variance_factor,
        codes=tuple(m.code for m in result.messages if m.level != "info"),
        cpu_s=cpu_s,
        failure="" if np.isfinite(error).all() else "a measurement has no value",
    )


def bound(squares: Sequence[np.ndarray]) -> float:
    """One-sided 95 % upper bound of the pooled z; surveys are what is drawn."""
    total = np.array([one.sum() for one in squares])
    count = np.array([len(one) for one in squares])
    drawn = np.random.default_rng(0).integers(len(total), size=(DRAWS, len(total)))
    pooled = np.sqrt(total[drawn].sum(axis=1) / count[drawn].sum(axis=1))
    return float(np.quantile(pooled, 0.95))


def row(outcomes: Sequence[Outcome]) -> str:
    """The table's line of one condition."""
    good = [one for one in outcomes if not one.failure]
    failed = len(outcomes) - len(good)
    if not good:
        return f"all {failed} failed: {outcomes[0].failure[:60]}"
    z, error, sigma = (
        np.concatenate([getattr(one, name) for one in good]) for name in ("z", "error", "sigma")
    )
    upper = bound([np.square(one.z) for one in good])
    blamed, named = (
        np.mean([bool(codes & set(one.codes)) for one in good]) for codes in (BLAMING, NAMING)
    )
    return (
        f"{np.sqrt(np.mean(z**2)):6.2f} {upper:6.2f} {100 * np.mean(np.abs(z) > 3):6.1f} "
        f"{100 * np.mean(np.abs(error)):6.2f} {100 * sigma.mean():6.2f} {failed:6d} "
        f"{100 * blamed:6.0f} {100 * named:6.0f} {np.mean([one.cpu_s for one in good]):6.2f}"
    )


def common_codes(outcomes: Sequence[Outcome]) -> str:
    """The commonest codes, with the number of surveys that have them."""
    count = Counter(code for one in outcomes for code in set(one.codes))
    return ", ".join(f"{code} {number}" for code, number in count.most_common(5))


def study(
    names: Sequence[str], seeds: Sequence[int], options: Mapping[str, object], workers: int
) -> Iterator[tuple[str, list[Outcome]]]:
    """Outcomes of every condition, one after another."""
    judge = partial(run_survey, options=options)
    with ProcessPoolExecutor(workers) as pool:
        for name in names:
            yield name, list(pool.map(judge, [(name, seed) for seed in seeds], chunksize=4))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("condition", nargs="*", choices=[[], *CONDITIONS])
    parser.add_argument("--surveys", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0, help="of the first survey")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--option", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--json", type=Path, help="every outcome, to look closer")
    parser.add_argument("--each", action="store_true", help="a line for each survey too")
    given = parser.parse_args()
    options = {key: yaml.safe_load(value) for key, value in (o.split("=", 1) for o in given.option)}
    seeds = range(given.seed, given.seed + given.surveys)
    heads = ("z", "<", ">3s", "error%", "sigma%", "failed", "blamed", "named", "cpu")
    print(f"{'':26s}" + " ".join(f"{head:>6s}" for head in heads))
    everything = []
    for name, outcomes in study(given.condition or list(CONDITIONS), seeds, options, given.workers):
        print(f"{name:26s}{row(outcomes)}   {common_codes(outcomes)}", flush=True)
        for one in outcomes if given.each else ():
            z = np.sqrt(np.mean(np.square(one.z))) if one.z else np.nan
            print(f"  {one.seed:5d} z {z:6.2f} factor {one.variance_factor:7.2f} {one.failure}")
        everything += outcomes
    if given.json:
        given.json.write_text(json.dumps([asdict(one) for one in everything]))


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
