"""Ground measurements with honest uncertainties from drone photos, flight logs and lengths.

>>> import uavgram
>>> result = uavgram.run("project.yaml")        # doctest: +SKIP
>>> result = uavgram.load_results("out/results.json")        # doctest: +SKIP
>>> table = uavgram.to_pandas(result, "measurements")        # doctest: +SKIP
>>> axes = uavgram.plots.plan(result)        # doctest: +SKIP

Importing loads nothing heavy and does nothing; the stages (``uavgram.stages``) and kernels
(``uavgram.geometry``) are public too.
"""

from __future__ import annotations

import importlib
import sys

TYPE_CHECKING = False  # typing takes longer to load than all of this
if TYPE_CHECKING:
    from typing import Any

    from uavgram.errors import UavgramError
    from uavgram.io.results.results_json import load_results
    from uavgram.model.result.result import Result
    from uavgram.pipeline.measure.run import run
    from uavgram.views import plots
    from uavgram.views.data_frames import to_pandas

__all__ = ["Result", "UavgramError", "load_results", "plots", "run", "to_pandas"]

_HOME = {
    "Result": "uavgram.model.result.result",
    "UavgramError": "uavgram.errors",
    "load_results": "uavgram.io.results.results_json",
    "plots": "uavgram.views",
    "run": "uavgram.pipeline.measure.run",
    "to_pandas": "uavgram.views.data_frames",
}


def __dir__() -> list[str]:
    """Return the public names, which are loaded on first access."""
    return sorted(__all__)


def __getattr__(name: str) -> Any:  # noqa: ANN401
    if name not in _HOME:
        raise AttributeError(f"module 'uavgram' has no attribute {name!r}")
    if "IPython" in sys.modules:  # from now on, it shows results as people read them
        importlib.import_module("uavgram.views.notebook").register_display()
    if name == "plots":
        return importlib.import_module("uavgram.views.plots")
    return getattr(importlib.import_module(_HOME[name]), name)
