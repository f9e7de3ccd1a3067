"""What a process of ours alone does without, and that nothing is missing for it."""

import subprocess
import sys

_ASKED = """
from uavgram.pipeline.own_process import load_little
load_little()
import sys
import numpy
from scipy.special import chdtri
was = type(sys.modules["numpy.ma"]).__name__
print(was, numpy.ma.masked_array([1, 2], [0, 1]).sum(), round(float(chdtri(1, 0.05)), 6))
print("Parameters" in chdtri.__doc__)
"""


def test_what_is_loaded_late_is_whole_once_it_is_asked_for() -> None:
    told = subprocess.run(
        [sys.executable, "-c", _ASKED], capture_output=True, text=True, check=True
    )

    assert told.stdout.split() == ["_LazyModule", "1", "3.841459", "False"]
