"""Where the tests find real flights: outside the repository, skipped with a reason when absent."""

from __future__ import annotations

import gc
import logging
import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

# Many small systems: threads inside one of them only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from scenes import Scene

# How long an example takes says how busy the machine is; and a failure that comes once in a hundred
# runs stops whoever did not make it.
settings.register_profile("steady", deadline=None, derandomize=True)
settings.load_profile("steady")

# Whoever runs in the background (`nohup`, a job of a shell) ignores these, and so would programs
# that a test starts in order to end them so.
for ignored, usual in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    number = getattr(signal, ignored, None)
    if number is not None and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, usual)

ROOT = Path(__file__).parents[1]

# A page that the developer has open must not be led to, nor seen by servers of another worker.
OWN_STATE = tempfile.TemporaryDirectory(prefix="uavgram-tests-")
os.environ["XDG_STATE_HOME"] = os.environ["LOCALAPPDATA"] = OWN_STATE.name


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--cpu", action="store_true", help="tell what tests cost, by folder and by test"
    )


def pytest_configure(config: pytest.Config) -> None:
    gc.disable()  # until all is collected, which leaves nothing behind
    if config.getoption("--cpu"):
        from cpu_of_tests import CpuOfTests

        config.pluginmanager.register(CpuOfTests())


def pytest_collection_finish() -> None:
    """Count modules and tests as permanent: looking through them again and again takes long."""
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def _logging_as_before() -> Iterator[None]:
    """A command sets up logging for its process: take that back, for its stream is closed then."""
    root, own = logging.getLogger(), logging.getLogger("uavgram")
    levels = root.level, own.level
    yield
    for logger, level in zip((root, own), levels, strict=True):
        logger.setLevel(level)
    for handler in root.handlers[:]:
        if type(handler) is logging.StreamHandler:
            root.removeHandler(handler)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of real flights, twins and calibration sets."""
    folder = Path(os.environ.get("UAVGRAM_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no flight data at {folder}; set UAVGRAM_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def repository() -> Path:
    """Root of the source tree: configs/ and logs/ lie below it."""
    return ROOT


@pytest.fixture(scope="session")
def scenes() -> ModuleType:
    """The module of small surveys with known truth: its sigmas and helpers."""
    import scenes as module

    return module


@pytest.fixture(scope="session")
def scene_factory() -> Callable[..., Scene]:
    """``make_scene``: small surveys with known truth, made without our own kernels."""
    from scenes import make_scene

    return make_scene
