"""`uavgram picks match` through the command line, on three small photos of one texture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_projects import Done
from textured_ground import NAMES, Textured, write_textured

from uavgram.cli import main
from uavgram.io.project_lock import ProjectLock


@pytest.fixture
def project(tmp_path: Path) -> Textured:
    return write_textured(tmp_path)


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Command:
    def run(*arguments: object) -> Done:
        capsys.readouterr()
        status = main(["picks", "match", *(str(argument) for argument in arguments)])
        said = capsys.readouterr()
        return Done(status, said.out, said.err)

    return run
