"""What a process of ours alone does without, and that nothing is missing for it."""

import subprocess
import sys

_ASKED = """
from uavgram.pipeline.own_process import load_little
load_little()
import sys
import numpy
import scipy.special  # loads it
print(type(sys.modules["numpy.ma"]).__name__, numpy.ma.masked_array([1, 2], [0, 1]).sum())
"""


def test_what_is_loaded_late_is_whole_once_it_is_asked_for() -> None:
    told = subprocess.run(
        [sys.executable, "-c", _ASKED], capture_output=True, text=True, check=True
    )

    assert told.stdout.split() == ["_LazyModule", "1"]
