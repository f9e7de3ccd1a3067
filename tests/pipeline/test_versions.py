"""With what a result was computed."""

from __future__ import annotations

import numpy as np

from uavgram.pipeline.versions import package_versions


def test_versions_are_those_of_the_packages() -> None:
    assert dict(package_versions(("numpy",)))["numpy"] == np.__version__
