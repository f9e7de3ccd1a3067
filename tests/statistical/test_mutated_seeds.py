"""Damaged logs: no seed moves by more than three sigma without a word.

A small share of the study, which is `python tests/support/mutated_seeds.py logs` (24,000 logs).
"""

from pathlib import Path

import mutated_seeds
import pytest


@pytest.mark.statistical
@pytest.mark.parametrize("suffix", mutated_seeds.SUFFIXES)
def test_damage_moves_no_seed_without_a_word(repository: Path, suffix: str) -> None:
    told = mutated_seeds.examine(repository / "logs", suffix, range(60), seconds=3.0)
    assert told["tried"] > 20
    assert told["read"] > 0.8 * told["tried"]  # damage is survived, not just refused
    assert told["crashed"] == []
    assert told["silent"] == []
