"""The output folder: results appear complete, or not at all."""

from __future__ import annotations

import errno
import logging
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Set
from contextlib import contextmanager, suppress
from pathlib import Path

from uavgram.errors import OutputError
from uavgram.io.locks import lock
from uavgram.io.own_files import NO_FOLLOW

log = logging.getLogger(__name__)

PREFIX = ".uavgram-unfinished-"
LAST = "results.json"  # whoever finds a new one finds everything else new too
NEW, EARLIER, MOVING = "files", "earlier", "moving.txt"
"""In the hidden folder: what is to be moved, what it replaces, and its list while it is moved."""
_END = Path()  # ends the list
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


@contextmanager
def staged_output(
    folder: str | Path,
    inputs: Iterable[str | Path] = (),
    photos: Iterable[str | Path] = (),
    hold: Callable[[], None] | None = None,
) -> Iterator[Path]:
    """Give a hidden folder to write into; move its files into `folder` once all are complete.

    The hidden folder lies inside `folder`, so on the same file system. Its files replace those of
    the same name one by one (``os.replace``), `results.json` last; other files stay. On any
    failure, Ctrl-C included, the files of `folder` are as before, and the hidden folder is gone;
    what a killed run left behind goes when the next run starts, and what it had moved already is
    put back.

    Parameters
    ----------
    folder
        The output folder; made where there is none.
    inputs
        Files that no output may replace.
    photos
        The originals: nothing is written into their folders.
    hold
        Raises where somebody else may write now (`uavgram.io.claims.claimed`). What others were
        moving when they were stopped is put back, and they cannot go on.

    Raises
    ------
    OutputError
        The folder cannot be written to, holds the photos, or one in it is a link that leads
        elsewhere; the disk is full; an output has the name of an input.
    """
    folder = Path(folder).absolute()
    photo_folders = {Path(path).resolve().parent for path in photos}
    _keep_apart(photo_folders, folder)
    with as_output_errors(folder):
        existed = folder.is_dir()
        folder.mkdir(parents=True, exist_ok=True)
        _remove_stale(folder)
        staging = Path(tempfile.mkdtemp(prefix=PREFIX, dir=folder))
        held = _lock(staging)
        try:
            (staging / NEW).mkdir()
            yield staging / NEW
            _check_targets(staging / NEW, folder, inputs, photo_folders)
            if hold is not None:
                hold()
                _stop_moving(folder, staging)
            _commit(staging, folder)
        finally:
            shutil.rmtree(staging, ignore_errors=True)
            if held is not None:
                os.close(held)
            if not existed:
                with suppress(OSError):  # it holds results now, or someone else's files
                    folder.rmdir()


def replace_text(path: Path, text: str) -> None:
    """Write a text file (UTF-8) in one step: see `replace_bytes`."""
    replace_bytes(path, text.encode())


def replace_bytes(path: Path, content: bytes) -> None:
    """Write a file in one step: the old one, or the new one, and nothing between.

    Raises
    ------
    OutputError
        The file cannot be written; an earlier one is untouched.
    """
    path = path.absolute()
    unfinished = path.with_name(f".{path.name}.unfinished")
    with as_output_errors(path.parent):
        try:
            unfinished.unlink(missing_ok=True)
            with unfinished.open("xb") as stream:  # never through a link
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)


@contextmanager
def as_output_errors(folder: Path) -> Iterator[None]:
    """Turn failures to write below `folder` into errors that say what to do."""
    try:
        yield
    except OSError as fault:
        name = os.fspath(fault.filename) if fault.filename is not None else ""
        is_ours = isinstance(name, str) and Path(name).is_relative_to(folder)
        if fault.errno in _FULL:
            why = "the disk is full; free some space, or choose another folder with --output"
        elif is_ours or name in {str(parent) for parent in folder.parents}:
            why = f"{fault.strerror} ({name}); choose another folder with --output"
        else:
            raise
        raise OutputError(
            f"{folder}: cannot write results, earlier ones are untouched; {why}"
        ) from fault


def _lock(staging: Path) -> int | None:
    """Mark a hidden folder as in use, for as long as this process lives."""
    handle = None
    with suppress(OSError):  # without locks, what killed runs left behind stays
        handle = os.open(staging, os.O_RDONLY)
        lock(handle)
    return handle


def _remove_stale(folder: Path) -> None:
    """Remove hidden folders and files whose process is no more."""
    for stale in folder.glob(f"{PREFIX}*"):
        with suppress(OSError):  # locked by a living run, or gone already
            handle = os.open(stale, os.O_RDONLY | NO_FOLLOW)
            try:
                lock(handle)
                log.info("removing %s, which a killed run left behind", stale)
                _put_back(stale, folder)
                shutil.rmtree(stale) if stale.is_dir() else stale.unlink()
            finally:
                os.close(handle)


def _stop_moving(folder: Path, own: Path) -> None:
    """Take their hidden folders from all others that are moving files, and put those back."""
    for other in folder.glob(f"{PREFIX}*"):
        if other != own and (other / MOVING).is_file():
            taken = own / other.name
            with suppress(FileNotFoundError):  # it came to its end
                other.rename(taken)
                _put_back(taken, folder)


def _keep_apart(photo_folders: Set[Path], folder: Path) -> None:
    """Refuse to write among the photos: the next run might take a result for one of them."""
    if folder.resolve() in photo_folders:
        raise OutputError(
            f"{folder}: holds the photos themselves, and nothing is written among them; choose "
            "another folder with --output (or `output` in the project)"
        )


def _check_targets(
    source: Path, folder: Path, inputs: Iterable[str | Path], photo_folders: Set[Path]
) -> None:
    """Refuse to write over what the outputs were made of, or through links that lead elsewhere."""
    kept = {Path(path).resolve() for path in inputs}
    for path in sorted(source.rglob("*")):
        target = folder / path.relative_to(source)
        real = target.resolve()
        if path.is_file() and real in kept:
            raise OutputError(
                f"{real}: is an input, and a result has the same name; nothing was written: "
                "choose another folder with --output (or `output` in the project), or rename the "
                "input"
            )
        if path.is_dir():
            _keep_apart(photo_folders, target)
            if not real.is_relative_to(folder.resolve()):
                raise OutputError(
                    f"{target}: is a link that leads out of the output folder, to {real}; "
                    "nothing was written: remove the link"
                )


def _commit(staging: Path, folder: Path) -> None:
    """Move all files into place; undo everything if one of them fails."""
    source, backup = staging / NEW, staging / EARLIER
    names = sorted(
        (path.relative_to(source) for path in source.rglob("*") if path.is_file()),
        key=lambda name: (name.as_posix() == LAST, name.as_posix()),
    )
    for name in names:
        _flush(source / name)
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if (folder / name).is_file():
            (backup / name).parent.mkdir(parents=True, exist_ok=True)
            _keep(folder / name, backup / name)
    (staging / MOVING).write_text("\n".join(name.as_posix() for name in [*names, _END]))
    _flush(staging / MOVING)
    try:
        for name in names:
            (source / name).replace(folder / name)
    except BaseException:
        # Whoever takes the hidden folder away puts back what is in it.
        for name in names if (staging / MOVING).is_file() else ():
            _restore(source / name, backup / name, folder / name)
        raise


def _put_back(stale: Path, folder: Path) -> None:
    """Undo what a run had moved when it was killed, unless it had moved everything."""
    if not (stale / MOVING).is_file():
        return
    *names, end = map(Path, (stale / MOVING).read_text().split("\n"))
    if not all(_is_own(stale, folder, name) for name in names):
        log.warning("%s is not of this program's making: nothing of it is put back", stale)
        return
    # Killed while the list was written: nothing had moved.
    if end == _END and any((stale / NEW / name).exists() for name in names):
        for name in names:
            _restore(stale / NEW / name, stale / EARLIER / name, folder / name)


def _is_own(stale: Path, folder: Path, name: Path) -> bool:
    """Whether a name leads nowhere else, as one in somebody's unpacked archive may."""
    homes = {stale / NEW: stale, stale / EARLIER: stale, folder: folder}
    return ".." not in name.parts and all(
        (home / name).parent.resolve().is_relative_to(own.resolve()) for home, own in homes.items()
    )


def _flush(path: Path) -> None:
    handle = os.open(path, os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _keep(path: Path, backup: Path) -> None:
    """Keep a second name of a file, which costs nothing; a copy where that is not possible."""
    try:
        backup.hardlink_to(path)
    except OSError:
        shutil.copy2(path, backup)


def _restore(source: Path, backup: Path, target: Path) -> None:
    if source.exists():
        return  # was not moved yet
    if backup.exists():
        backup.replace(target)
    else:
        target.unlink(missing_ok=True)
