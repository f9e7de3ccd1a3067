"""Log of a run: steps with times and durations; written as run.jsonl."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from uavgram.model.result.result import Result

log = logging.getLogger(__name__)


class Journal:
    """Records of one run, in order; the only object of a run that grows."""

    def __init__(self) -> None:
        self._lines: list[dict[str, object]] = []

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time a step; a failed step leaves no record, as the run leaves no file."""
        log.info("%s", name)
        started = time.perf_counter()
        yield
        self.note("step", name=name, seconds=round(time.perf_counter() - started, 4))

    def note(self, event: str, **fields: object) -> None:
        """Add a record."""
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        self._lines.append({"time_utc": now, "event": event, **fields})

    def result(self, result: Result) -> None:
        """Record the solution and the messages of the run."""
        solution = result.solution
        self.note(
            "solution",
            iterations=solution.iterations,
            converged=solution.converged,
            degrees_of_freedom=solution.degrees_of_freedom,
        )
        for message in result.messages:
            self.note("message", **message.record())

    def write(self, path: Path) -> None:
        """Write one JSON object per line."""
        text = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in self._lines)
        path.write_text(text, encoding="utf-8")
