"""State of a batch: a line of JSON for each measured survey, appended when it ends.

A killed batch leaves at most an incomplete line, which is ignored.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from uavgram.io.digest import digest_file
from uavgram.io.results.codec import encode, from_record
from uavgram.model.batch import FileState, SurveyRecord
from uavgram.model.provenance import InputDigest

STATE = "batch-state.jsonl"


def read_records(path: Path) -> dict[str, SurveyRecord]:
    """Read the newest record of each project, by its file; empty where there is no state.

    Unreadable lines, such as those of another version, are left out: the survey is measured again.
    """
    try:
        lines = path.read_bytes().splitlines()
    except OSError:
        return {}
    found: dict[str, SurveyRecord] = {}
    for line in lines:
        try:
            record = from_record(SurveyRecord, json.loads(line))
        except (ValueError, TypeError, KeyError, AttributeError):
            continue
        found[record.row.project] = record
    return found


def append_record(path: Path, record: SurveyRecord) -> None:
    """Append a record; it is on disk when this returns.

    Raises
    ------
    OSError
        The disk is full or not writable.
    """
    line = json.dumps(encode(record), ensure_ascii=False).encode() + b"\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab+") as stream:
        if stream.tell():
            stream.seek(-1, os.SEEK_END)
            if stream.read(1) != b"\n":
                line = b"\n" + line  # a killed batch left the last one incomplete
        stream.write(line)
        stream.flush()
        os.fsync(stream.fileno())


def read_file_stat(path: str | Path) -> tuple[int, int]:
    """Return size and modification time [ns]; (-1, -1) for a missing file."""
    try:
        found = Path(path).stat()
    except OSError:
        return -1, -1
    return found.st_size, found.st_mtime_ns


def read_file_state(path: str | Path) -> FileState:
    """Return the current state of a file; a change while it is read is noticed next time.

    Raises
    ------
    InputError
        It cannot be read.
    """
    _, changed = read_file_stat(path)
    digest: InputDigest = digest_file(path)
    return FileState(
        path=str(path), size_bytes=digest.size_bytes, changed_ns=changed, sha256=digest.sha256
    )


def is_unchanged(state: FileState) -> bool:
    """Return whether a file has its earlier content; a new modification time alone is no change."""
    size, changed = read_file_stat(state.path)
    if size != state.size_bytes:
        return False
    return changed == state.changed_ns or digest_file(state.path).sha256 == state.sha256
