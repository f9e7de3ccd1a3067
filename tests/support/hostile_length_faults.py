"""What people do wrong with lengths: see `hostile_faults`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hostile_faults import Fault, Faulty, Sound, Wrong, length_names, often_seen

FOOT_M = 0.3048
APART_M = 0.5
"""Least difference of two readings that are taken for each other."""


def one_length(sound: Sound, reading: Callable[[float, np.random.Generator], float]) -> Faulty:
    """One length read in another way."""
    survey, rng = sound.survey, sound.rng
    line = int(rng.integers(len(survey.line)))
    length = survey.line_length_m.copy()
    length[line] = reading(float(length[line]), rng)
    return Faulty(
        survey=replace(survey, line_length_m=length), wrong=Wrong(lengths=length_names([line]))
    )


def in_feet(length_m: float, rng: np.random.Generator) -> float:
    """Metres were meant."""
    del rng
    return length_m / FOOT_M


def off_by(*by_m: float) -> Callable[[float, np.random.Generator], float]:
    """One of these errors, up or down."""
    return lambda length_m, rng: length_m + float(rng.choice(by_m) * rng.choice([-1.0, 1.0]))


def transposed(length_m: float, rng: np.random.Generator) -> float:
    """Two neighbouring digits exchanged: 7.38 was written as 7.83."""
    digits = f"{length_m:.2f}".replace(".", "")
    for k in rng.permutation(len(digits) - 1).tolist():
        other = int(digits[:k] + digits[k + 1] + digits[k] + digits[k + 2 :]) / 100
        if abs(other - length_m) > APART_M / 2 and other > 1.0:
            return other
    return length_m + 1.0  # such as 11.11 m


def other_ends(sound: Sound) -> Faulty:
    """One length is written down for another pair of labels."""
    survey, rng = sound.survey, sound.rng
    line = survey.line.copy()
    k = int(rng.integers(len(line)))
    stays = survey.world_m[line[k, 0]]
    far = np.linalg.norm(survey.world_m - stays, axis=1) - survey.line_length_m[k]
    other = [x for x in often_seen(survey) if abs(far[x]) > APART_M and x not in line[k]]
    line[k, 1] = rng.choice(other)
    return Faulty(survey=replace(survey, line=line), wrong=Wrong(lengths=length_names([k])))


def readings_exchanged(sound: Sound) -> Faulty:
    """The readings of two lengths exchanged."""
    survey = sound.survey
    length = survey.line_length_m.copy()
    apart = np.abs(length[:, None] - length) > APART_M
    pairs = np.argwhere(np.triu(apart))
    one, other = sound.rng.choice(pairs)
    length[[one, other]] = length[[other, one]]
    wrong = Wrong(lengths=length_names([one, other]))
    return Faulty(survey=replace(survey, line_length_m=length), wrong=wrong)


def all_lengths(sound: Sound, factor: float = 1.0, offset_m: float = 0.0) -> Faulty:
    """All lengths too long by a factor, or by an offset."""
    survey = sound.survey
    length = survey.line_length_m * factor + offset_m
    wrong = Wrong(lengths=length_names(range(len(length))))
    return Faulty(survey=replace(survey, line_length_m=length), wrong=wrong)


def length_twice(sound: Sound) -> Faulty:
    """The same row stands in the list twice."""
    survey = sound.survey
    k = int(sound.rng.integers(len(survey.line)))
    line = np.concatenate([survey.line, survey.line[[k]]])
    length = np.append(survey.line_length_m, survey.line_length_m[k])
    wrong = Wrong(lengths=length_names([k, len(line) - 1]))
    return Faulty(survey=replace(survey, line=line, line_length_m=length), wrong=wrong)


def untaped(sound: Sound, fault: Fault) -> Faulty:
    """No length was taped: the log alone says how large everything is."""
    faulty = fault(sound)
    survey = faulty.survey
    no_lines = replace(survey, line=survey.line[:0], line_length_m=survey.line_length_m[:0])
    return replace(faulty, survey=no_lines)
