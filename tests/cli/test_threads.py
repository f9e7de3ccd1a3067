"""The command gives small matrices and OpenCV one thread, unless the user says otherwise."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

PROGRAM = """
import os, sys
from uavgram.cli import main
print("numpy" in sys.modules, "cv2" in sys.modules)
main(["check", "nowhere.yaml"])
print("numpy" in sys.modules, os.environ["OPENBLAS_NUM_THREADS"])
import cv2
print(cv2.getNumThreads())
"""
THREADS = ("OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


@pytest.mark.parametrize(("given", "expected"), [(None, "1"), ("3", "3")])
def test_it_is_settled_before_they_are_loaded(given: str | None, expected: str) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in THREADS}
    if given is not None:
        environment.update(dict.fromkeys(THREADS, given))
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == ["False False", f"True {expected}", expected]
