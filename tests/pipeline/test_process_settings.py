"""What a process of ours alone does without, and that nothing is missing for it."""

import subprocess
import sys

_ASKED = """
from uavgram.pipeline.process_settings import LATE_MODULES, avoid_modules
avoid_modules()
import sys
import numpy, PIL.Image
import uavgram.pipeline.measure.outputs
numpy.median([1.0, 2.0])
PIL.Image.new("L", (1, 1)).getexif()
print(sorted(
    name for name in LATE_MODULES if type(sys.modules.get(name)).__name__ != "_LazyModule"
))
import numpy, ezdxf, scipy.spatial
turn = scipy.spatial.transform.Rotation.from_rotvec([0, 0, 1])
print(numpy.polynomial.Polynomial([1, 2])(1.0), turn.magnitude())
print(len(ezdxf.tools.pattern.load()) > 100)
"""


def test_what_is_loaded_late_is_whole_once_asked_for_and_no_thread_asks_for_it() -> None:
    """A median and the tags of a photo, which threads ask for, execute nothing that is late."""
    told = subprocess.run(
        [sys.executable, "-c", _ASKED], capture_output=True, text=True, check=True
    )

    assert told.stdout.split() == ["[]", "3.0", "1.0", "True"]
