"""What the program says of a survey in which something is wrong, and what it measures then."""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import hostile_faults as faults
import numpy as np
from hostile_causes import CASES, Case
from hostile_faults import Faulty, Sound, Wrong
from hostile_project import write_project
from hostile_surveys import make_survey
from true_mends import is_repaired
from untreated import UNTREATED, nothing_treated

from uavgram.errors import UavgramError
from uavgram.model.message import Message
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.compute import Computation, compute
from uavgram.pipeline.measure.inputs import read_inputs

REMOVED: Mapping[str, object] = {"solve.outliers": "remove"}
TELLS = 4.0
"""Sigmas of misfit from which on lengths that are all wrong alike contradict the rest."""
UNCHECKED = frozenset(
    {"nothing-checks", "ambiguous-pose", "three-lengths", "three-known", "measurement-null"}
)
"""Codes of what is amber though nothing misfits."""
BLAMES = ("line-", "lines-", "lengths-")


@dataclass(frozen=True, kw_only=True)
class Told:
    """One thing that was said, and of what."""

    code: str
    text: str
    frames: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    lengths: tuple[str, ...] = ()

    def fits(self, codes: frozenset[str], wrong: Wrong) -> bool:
        """Whether it is of such a code, and of nothing that is in order."""
        pairs = [
            (self.frames, wrong.frames),
            (self.labels, wrong.labels),
            (self.lengths, wrong.lengths or None),
        ]
        return self.code in codes and all(
            truth is None or set(named) <= truth for named, truth in pairs
        )

    def accuses(self, wrong: Wrong) -> bool:
        """Whether it blames a length that is right."""
        return self.code.startswith(BLAMES) and bool(set(self.lengths) - wrong.lengths)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One survey.

    Attributes
    ----------
    case, seed
        Which.
    z, untreated_z
        Root mean squares of error over sigma: as the program has it, and at the stated noise with
        nothing left out, learnt or mended; infinite where that fails.
    told
        Warnings and errors, what is said first at the head.
    first, exactly, anywhere, learnt
        Whether the cause is named first and rightly, with the code that says most, or anywhere; or
        is told by a learnt value.
    accused
        Whether what is said first blames a length that is right.
    level
        Of the verdict; empty where there is none yet.
    tellable
        Whether the survey can show what is wrong at all.
    repaired
        Whether just that was mended which is wrong.
    cpu_s, clean_cpu_s
        Reading and computing: this one, and without the fault.
    failure
        Why there is no result; empty where there is.
    """

    case: str
    seed: int
    z: float = float("nan")
    untreated_z: float = float("nan")
    told: tuple[Told, ...] = ()
    first: bool = False
    exactly: bool = False
    anywhere: bool = False
    learnt: bool = False
    accused: bool = False
    level: str = ""
    tellable: bool = True
    repaired: bool = False
    cpu_s: float = float("nan")
    clean_cpu_s: float = float("nan")
    failure: str = ""
    wrong: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def named(self) -> bool:
        """Whether the cause is told as it has to be."""
        return self.first or self.learnt

    @property
    def misfits(self) -> bool:
        """Whether something is said not to fit; that nothing checks a value is no misfit."""
        return self.level != "green" and any(one.code not in UNCHECKED for one in self.told)


def run_case(
    job: tuple[str, int], options: Mapping[str, object], *, compared: bool, dense: bool = False
) -> Outcome:
    """Make, run and judge the survey of a case and a seed.

    Parameters
    ----------
    job
        Case and seed.
    options
        Of the project.
    compared
        Whether it is run untreated, and without the fault, too.
    dense
        Whether every label is picked wherever it is seen: then all is checked by something.
    """
    name, seed = job
    case = CASES[name]
    if dense:
        case = replace(case, condition=replace(case.condition, picked_share=1.0))
    sound = make_sound(case, seed)
    faulty = case.fault(sound)
    own = Outcome(case=name, seed=seed, wrong=_names(faulty.wrong))
    if compared:
        own = replace(own, **_beside(case, sound, faulty, options)._asdict())
    try:
        (result, refined), cpu_s = run_survey(faulty, options)
    except (UavgramError, np.linalg.LinAlgError) as fault:  # the latter is the program's own
        return replace(own, failure=str(fault))
    told = what_is_told(result)
    fits = [one.fits(case.exact | case.also, faulty.wrong) for one in told]
    return replace(
        own,
        z=z_of(result, faulty.survey.truth),
        told=told,
        first=fits[:1] == [True],
        exactly=bool(told) and told[0].fits(case.exact, faulty.wrong),
        anywhere=any(fits),
        learnt=case.learnt is not None and case.learnt(result),
        accused=bool(told) and told[0].accuses(faulty.wrong),
        level=str(getattr(getattr(result, "verdict", None), "level", "")),
        repaired=case.mended and is_repaired(refined, faulty.survey, sound.survey),
        cpu_s=cpu_s,
    )


def make_sound(case: Case, seed: int) -> Sound:
    """The survey of a case, before its fault."""
    rng = np.random.default_rng([seed, 99])
    return Sound(make_survey(case.condition, seed), case.condition, seed, rng)


def run_survey(faulty: Faulty, options: Mapping[str, object]) -> tuple[Computation, float]:
    """What is computed, and the seconds that took."""
    with TemporaryDirectory(prefix="causes") as folder:
        project = write_project(faulty.survey, Path(folder), options)
        for copy, original in faulty.copies.items():
            shutil.copy(Path(folder) / f"{original}.jpg", Path(folder) / f"{copy}.jpg")
        start = time.process_time()
        computed = compute(read_inputs(project), curved=False)
        return computed, time.process_time() - start


def z_of(result: Result, truth: Mapping[str, float]) -> float:
    """Root mean square of error over sigma, of what has a value."""
    measured = result.measurements
    error = measured.value - np.array([truth[name] for name in measured.name])
    z = (error / measured.sigma)[np.isfinite(error)]
    return float(np.sqrt(np.mean(z**2))) if len(z) else float("nan")


def what_is_told(result: Result) -> tuple[Told, ...]:
    """Reasons of the verdict, where there is one, then all warnings and errors."""
    verdict = getattr(result, "verdict", None)
    reasons = [
        Told(code=r.cause, text=r.text, frames=r.frames, labels=r.labels, lengths=r.lengths)
        for r in getattr(verdict, "reasons", ())
    ]
    return (*reasons, *(_told(m) for m in result.messages if m.level != "info"))


def _told(message: Message) -> Told:
    return Told(
        code=message.code,
        text=message.text,
        frames=message.frames,
        labels=message.labels,
        lengths=message.lengths,
    )


class _Beside(NamedTuple):
    """What the survey is without any treatment, and without the fault."""

    untreated_z: float
    tellable: bool
    clean_cpu_s: float


def _beside(case: Case, sound: Sound, faulty: Faulty, options: Mapping[str, object]) -> _Beside:
    untreated = _untreated(faulty)
    is_dense = case.condition.picked_share == 1.0
    with_log = "clean_dense" if is_dense else "clean"
    clean = with_log if case.condition.has_log else "clean_no_log"
    return _Beside(
        float("inf") if untreated is None else z_of(untreated, faulty.survey.truth),
        not case.common or _cost(untreated) - _cost(_untreated(faults.none(sound))) > TELLS**2,
        _clean_cpu_s(clean, sound.seed, tuple(options.items())),
    )


def _untreated(faulty: Faulty) -> Result | None:
    try:
        with nothing_treated():
            return run_survey(faulty, UNTREATED)[0].result
    except (UavgramError, np.linalg.LinAlgError):
        return None


def _cost(result: Result | None) -> float:
    """Weighted sum of squares."""
    if result is None:
        return float("inf")
    return result.solution.variance_factor * result.solution.degrees_of_freedom


@lru_cache(maxsize=64)
def _clean_cpu_s(name: str, seed: int, options: tuple[tuple[str, object], ...]) -> float:
    case = CASES[name]
    return run_survey(case.fault(make_sound(case, seed)), dict(options))[1]


def _names(wrong: Wrong) -> Mapping[str, tuple[str, ...]]:
    return {
        "frames": tuple(sorted(wrong.frames or ())),
        "labels": tuple(sorted(wrong.labels or ())),
        "lengths": tuple(sorted(wrong.lengths)),
    }
