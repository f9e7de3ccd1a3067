"""A project that is open for picking, in this process: what the page's server asks, without it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from own_loop import run_alone

from uavgram.picking.document.commands import ProjectAction
from uavgram.picking.protocol.messages import ServerMessage
from uavgram.picking.protocol.parse import parse_message
from uavgram.picking.session.project import OpenProject
from uavgram.picking.storage.tables import Tables
from uavgram.pipeline.pick.live_survey import LiveSurvey

Json = dict[str, Any]


@contextmanager
def opened(path: Path, *, killed: bool = False) -> Iterator[tuple[OpenProject, list[Json]]]:
    """A project, and what its pages are sent; at the end it is saved unless it is `killed`.

    The system takes the lock of a killed process back; here that is done by letting go.
    """
    sent: list[Json] = []
    survey = LiveSurvey.open(path)

    def send(message: ServerMessage) -> None:
        sent.append(dict(message))

    project = OpenProject(survey, Tables(survey.inputs), lambda: None, send, Tables)
    try:
        yield project, sent
    finally:
        if not killed:
            project.picking.save()
        project.picking.saver.close()


def change(project: OpenProject, kind: str, /, **fields: object) -> Json:
    """Do what a page's command says."""
    message = json.dumps({"seq": 1, "t": kind, **fields})
    return dict(project.picking.change(parse_message(message, project.picking.photos)))


def ask(project: OpenProject, kind: str) -> Json:
    """Ask something of the project as a whole."""
    message = parse_message(json.dumps({"seq": 1, "t": kind}), project.picking.photos)
    action = message.body
    assert isinstance(action, ProjectAction)
    return dict(run_alone(project.do(action)))
