"""One thread for the linear algebra during calls of this program.

Sums over blocks of another size are rounded differently, and BLAS divides blocks by the number of
its threads: for equal results on every machine one thread is used. Besides, most matrices here are
small: more threads wait for each other longer than they help.
"""

from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

# Only libraries that are loaded can be limited, and these two bring one each.
import numpy.linalg  # noqa: F401
import scipy.linalg  # noqa: F401
from threadpoolctl import LibController, OpenBLASController, ThreadpoolController

Arguments = ParamSpec("Arguments")
Value = TypeVar("Value")

_OF_EACH_THREAD = "openmp"
"""Layer of libraries with a setting for each calling thread; others have one for all."""

_lock = threading.Lock()
_inside = 0
_before: list[tuple[LibController, int]] = []
"""Setting of all threads of the caller."""


def _libraries() -> ThreadpoolController:
    return _found(opencv="cv2" in sys.modules)


@functools.cache
def _found(*, opencv: bool) -> ThreadpoolController:  # noqa: ARG001  (it brings another BLAS)
    return ThreadpoolController().select(user_api="blas")


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread; the previous setting is always restored at the end.

    With most libraries the setting is one for the whole process, so calls that overlap in time
    share it: the first one sets it, and the last one to end restores it.
    """
    with _libraries().select(threading_layer=_OF_EACH_THREAD).limit(limits=1):
        _enter()
        try:
            yield
        finally:
            _leave()


def _enter() -> None:
    global _inside  # noqa: PLW0603  (a setting of the process needs a count of the process)
    with _lock:
        if _inside == 0:
            libraries = _libraries().lib_controllers
            shared = [one for one in libraries if not _is_of_each_thread(one)]
            _before[:] = [(one, one.num_threads) for one in shared]
            _set([(one, 1) for one in shared])
        _inside += 1


def _leave() -> None:
    global _inside  # noqa: PLW0603
    with _lock:
        _inside -= 1
        if _inside == 0:
            _set(_before)


def _is_of_each_thread(library: LibController) -> bool:
    return getattr(library, "threading_layer", "") == _OF_EACH_THREAD


def _set(numbers: list[tuple[LibController, int]]) -> None:
    """Set numbers of threads, from any thread.

    threadpoolctl accepts one thread only, the first that ever sets a number, until that one gives
    up its right; otherwise a run from another thread would not be limited at all.
    """
    OpenBLASController.clear_controlling_thread(force=True)
    for library, number in numbers:
        library.set_num_threads(number)
    OpenBLASController.clear_controlling_thread(force=True)


def limit_blas_threads(call: Callable[Arguments, Value]) -> Callable[Arguments, Value]:
    """Decorate a function: it runs inside `one_blas_thread`."""

    @functools.wraps(call)
    def limited(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Value:
        with one_blas_thread():
            return call(*args, **kwargs)

    return limited
