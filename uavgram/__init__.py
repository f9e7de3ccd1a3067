"""Ground measurements with honest uncertainties from drone photos, flight logs and lengths.

>>> import uavgram
>>> result = uavgram.run("project.yaml")        # doctest: +SKIP
>>> result = uavgram.load_results("out/results.json")        # doctest: +SKIP

Importing loads nothing heavy and does nothing; the stages (``uavgram.stages``) and kernels
(``uavgram.geometry``) are public too.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from uavgram.errors import UavgramError
    from uavgram.io.results.results_json import load_results
    from uavgram.model.result.result import Result
    from uavgram.pipeline.measure.run import run

__all__ = ["Result", "UavgramError", "load_results", "run"]

_HOME = {
    "Result": "uavgram.model.result.result",
    "UavgramError": "uavgram.errors",
    "load_results": "uavgram.io.results.results_json",
    "run": "uavgram.pipeline.measure.run",
}


def __dir__() -> list[str]:
    """The public names, which are loaded when they are asked for."""
    return sorted(__all__)


def __getattr__(name: str) -> Any:  # noqa: ANN401
    if name not in _HOME:
        raise AttributeError(f"module 'uavgram' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
