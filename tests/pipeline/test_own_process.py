"""What a process of ours alone does without, and that nothing is missing for it."""

import subprocess
import sys

_ASKED = """
from uavgram.pipeline.own_process import LATE, load_little
load_little()
import sys
import uavgram.pipeline.measure.run
print(sorted(name for name in LATE if type(sys.modules.get(name)).__name__ != "_LazyModule"))
import numpy, ezdxf, scipy.spatial
turn = scipy.spatial.transform.Rotation.from_rotvec([0, 0, 1])
print(numpy.ma.masked_array([1, 2], [0, 1]).sum(), turn.magnitude())
print(len(ezdxf.tools.pattern.load()) > 100)
"""


def test_what_is_loaded_late_is_whole_once_it_is_asked_for() -> None:
    told = subprocess.run(
        [sys.executable, "-c", _ASKED], capture_output=True, text=True, check=True
    )

    assert told.stdout.split() == ["[]", "1", "1.0", "True"]
