"""What tests cost: `pytest --cpu` tells CPU seconds by folder, and of the dearest tests.

User and system, of the test's process and of those that it started: unlike time on the clock, they
depend little on what else the machine does. A process counts when it ends, so that a browser that
serves many tests counts with the last of them, as far as the system hands on what it used.
"""

from __future__ import annotations

import resource
from collections.abc import Generator
from pathlib import PurePath

import pytest

DEAREST = 30
NAME = "cpu_s"


def cpu_s() -> float:
    """Of this process and of all that ended below it."""
    who = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    return sum(used.ru_utime + used.ru_stime for used in map(resource.getrusage, who))


class CpuOfTests:
    """Counts where tests run, and adds up where they are reported."""

    def __init__(self) -> None:
        self._before = cpu_s()
        self._of: dict[str, float] = {}

    def pytest_collection_finish(self) -> None:
        self._before = cpu_s()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self,
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        report = yield
        now = cpu_s()
        report.user_properties.append((NAME, now - self._before))
        self._before = now
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        used = sum(float(str(value)) for name, value in report.user_properties if name == NAME)
        self._of[report.nodeid] = self._of.get(report.nodeid, 0.0) + used

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        folders: dict[str, float] = {}
        for test, used in self._of.items():
            folder = "/".join(PurePath(test.partition("::")[0]).parts[:2])
            folders[folder] = folders.get(folder, 0.0) + used
        terminalreporter.section(f"CPU: {sum(folders.values()):.0f} s")
        for costs, most in ((folders, len(folders)), (self._of, DEAREST)):
            for name in sorted(costs, key=costs.__getitem__, reverse=True)[:most]:
                terminalreporter.write_line(f"{costs[name]:8.2f} s  {name}")
            terminalreporter.write_line("")
