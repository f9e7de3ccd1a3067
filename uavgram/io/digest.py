"""SHA-256 digests of input files, for the chain of custody."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from uavgram.errors import InputError
from uavgram.model.provenance import InputDigest
from uavgram.model.result.tables import FrameResults


def digest_inputs(
    paths: Iterable[str | Path], folder: str | Path | None = None
) -> tuple[InputDigest, ...]:
    """Digest input files, each once, in the given order.

    Parameters
    ----------
    paths
        The files.
    folder
        Paths inside this folder (the project's) are named relative to it, with ``/``, so that
        results do not depend on the project's location; others are unchanged.

    Raises
    ------
    InputError
        A file cannot be read.
    """
    return tuple(digest_file(path, folder) for path in dict.fromkeys(map(Path, paths)))


def digest_file(path: str | Path, folder: str | Path | None = None) -> InputDigest:
    """Digest one input file; see `digest_inputs`."""
    path = Path(path)
    try:
        with path.open("rb") as stream:
            sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
            size = os.fstat(stream.fileno()).st_size
    except OSError as fault:
        raise InputError(path, f"cannot be read: {fault.strerror}") from fault
    name = str(path) if folder is None else find_relative_name(path, folder)
    return InputDigest(path=name, sha256=sha256, size_bytes=size)


def find_relative_name(path: str | Path, folder: str | Path) -> str:
    """Return a path relative to a folder, with ``/``; one outside of it unchanged."""
    whole = Path(path).absolute()
    return whole.relative_to(folder).as_posix() if whole.is_relative_to(folder) else str(path)


def photo_files(frames: FrameResults) -> tuple[str, ...]:
    """Return the (F,) paths by which the photos of a result can be opened."""
    return tuple(str(Path(frames.folder) / path) for path in frames.path)
