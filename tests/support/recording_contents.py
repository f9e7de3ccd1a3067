"""A recording, read back from its file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader

from uavgram.views.recording.stream import FIRST


class Contents:
    """Columns of a recording by entity: static values, and by frame."""

    def __init__(self, path: Path) -> None:
        self.static: dict[str, dict[str, list[Any]]] = {}
        self.by_frame: dict[str, dict[str, dict[int, Any]]] = {}
        self.timelines: set[str] = set()
        for chunk in RrdReader(str(path)).stream().to_chunks():
            columns = chunk.to_record_batch().to_pydict()
            self.timelines |= set(chunk.timeline_names)
            data = {name: column for name, column in columns.items() if ":" in name}
            if chunk.is_static:
                into = self.static.setdefault(chunk.entity_path, {})
                into.update({name: column[-1] for name, column in data.items()})
                continue
            for name, column in data.items():
                rows = self.by_frame.setdefault(chunk.entity_path, {}).setdefault(name, {})
                for frame, value in zip(columns["frame"], column, strict=True):
                    rows[frame - FIRST] = value
