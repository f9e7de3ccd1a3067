"""The project's tables on disk: picks.csv, lines.csv and measure.csv of one session."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from uavgram.io.outputs import replace_text
from uavgram.picking import commands as c
from uavgram.picking.autosave import JOURNAL, Journal, unsaved
from uavgram.picking.session import Session, apply
from uavgram.picking.state import State, state_of
from uavgram.pipeline.inputs import Inputs


class Tables:
    """Keeps what the page confirms: a journal at once, the tables when asked to.

    Parameters
    ----------
    inputs
        The project as read.
    """

    def __init__(self, inputs: Inputs) -> None:
        project = inputs.project
        beside = Path(inputs.project_path).absolute().parent
        self._picks = Path(project.picks)
        self._lines = Path(project.lines or beside / "lines.csv")
        self._measure = Path(project.measure or beside / "measure.csv")
        self._files = state_of(inputs.picks, inputs.lines, inputs.requests)
        self._saved = self._files
        path = Path(project.output) / JOURNAL
        self._lost = tuple(unsaved(path))
        self._journal = Journal(path)

    def recovered(self) -> State | None:
        """The state that an earlier session confirmed and did not save; None: nothing is lost."""
        session = Session(state=self._files)
        for command, step in self._lost:
            session = apply(session, command, step)
        return session.state if self._lost else None

    def record(self, command: c.Command, step: int) -> None:
        """Keep a command that was applied, before it is confirmed."""
        self._journal.record(command, step)

    def save(self, state: State) -> str:
        """Write the tables that changed; returns what kept it from doing so, or nothing."""
        if state == self._saved:
            return ""
        if state.picks != self._saved.picks:
            header = ["image", "label", "u_px", "v_px", "sigma_px", "height_m"]
            rows = [
                [p.image, p.label, repr(p.u_px), repr(p.v_px), _cell(p.sigma_px), _cell(p.height_m)]
                for p in state.picks
            ]
            replace_text(self._picks, _table(header, rows))
        if state.lines != self._saved.lines:
            header = ["name", "from", "to", "length_m", "sigma_m", "use"]
            rows = [
                [n.name, n.start, n.end, repr(n.length_m), repr(n.sigma_m), _use(adjust=n.adjust)]
                for n in state.lines
            ]
            replace_text(self._lines, _table(header, rows))
        if state.requests != self._saved.requests:
            header = ["name", "kind", "points", "parameters"]
            rows = [
                [
                    r.name,
                    r.kind,
                    ";".join(r.points),
                    ";".join(f"{k}={v!r}" for k, v in r.parameters),
                ]
                for r in state.requests
            ]
            replace_text(self._measure, _table(header, rows))
        self._saved = state
        self._journal.saved()
        return ""

    def close(self) -> None:
        """Let go of the journal."""
        self._journal.close()


def _cell(value: float | None) -> str:
    return "" if value is None else repr(value)


def _use(*, adjust: bool) -> str:
    return "adjust" if adjust else "check"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()
