"""Who ran the program, and with what."""

from __future__ import annotations

import getpass
from typing import Never

import numpy as np
import pytest

from uavgram.pipeline.versions import NO_ACCOUNT, account_name, package_versions


def test_the_account_is_that_of_the_operating_system(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOGNAME", "ada")
    assert account_name() == "the account ada"


@pytest.mark.parametrize("fault", [KeyError("getpwuid(): uid not found: 4711"), OSError()], ids=str)
def test_an_account_without_a_name_is_said(
    monkeypatch: pytest.MonkeyPatch, fault: Exception
) -> None:
    def nobody() -> Never:
        raise fault

    monkeypatch.setattr(getpass, "getuser", nobody)
    assert account_name() == NO_ACCOUNT


def test_versions_are_those_of_the_packages() -> None:
    assert dict(package_versions(("numpy",)))["numpy"] == np.__version__
