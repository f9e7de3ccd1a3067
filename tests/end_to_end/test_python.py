"""The package from Python: `uavgram.run`, `uavgram.load_results`, and an import without weight."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from flight_projects import Demo

import uavgram


def assert_same(one: object, other: object, where: str = "result") -> None:
    """Equal field by field, to the last bit, NaN equal to NaN."""
    assert type(one) is type(other), where
    if dataclasses.is_dataclass(one):
        for field in dataclasses.fields(one):
            name = field.name
            assert_same(getattr(one, name), getattr(other, name), f"{where}.{name}")
    elif isinstance(one, np.ndarray):
        assert isinstance(other, np.ndarray)
        assert one.dtype == other.dtype, where
        np.testing.assert_array_equal(one, other, err_msg=where)
    elif isinstance(one, tuple):
        assert isinstance(other, tuple)
        assert len(one) == len(other), where
        for k, pair in enumerate(zip(one, other, strict=True)):
            assert_same(*pair, f"{where}[{k}]")
    elif isinstance(one, Mapping):
        assert isinstance(other, Mapping)
        assert list(one) == list(other), where
        for key, value in one.items():
            assert_same(value, other[key], f"{where}[{key!r}]")
    elif isinstance(one, float) and np.isnan(one):
        assert isinstance(other, float)
        assert np.isnan(other), where
    else:
        assert one == other, where


def test_the_module_shows_what_it_is_for() -> None:
    public = {"run", "load_results", "to_pandas", "plots", "Result", "UavgramError"}

    assert set(dir(uavgram)) == public


@pytest.mark.parametrize("name", ["calibrate", "refine", "seed", "synchronise"])
def test_a_stage_is_imported_from_the_package_of_its_name(name: str) -> None:
    package = importlib.import_module(f"uavgram.stages.{name}")
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        importlib.import_module(module.name)  # a module of the same name would hide the function
    assert inspect.isfunction(getattr(package, name))


def test_loading_gives_the_object_that_run_returned(demo: Demo, tmp_path: Path) -> None:
    returned = uavgram.run(demo.project, output=tmp_path / "out")
    # Where the project was is not in files, which may be moved.
    frames = dataclasses.replace(returned.frames, folder="")
    stored = dataclasses.replace(returned, frames=frames)
    assert_same(stored, uavgram.load_results(tmp_path / "out" / "results.json"))
    assert isinstance(returned, uavgram.Result)


def test_output_none_writes_nothing(
    demo: Demo, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    before = {path: path.stat().st_mtime_ns for path in demo.folder.rglob("*")}
    uavgram.run(demo.project, output=None)
    assert {path: path.stat().st_mtime_ns for path in demo.folder.rglob("*")} == before
    assert list(tmp_path.iterdir()) == []


def test_result_is_frozen(demo: Demo) -> None:
    result = uavgram.load_results(demo.out / "results.json")
    with pytest.raises(ValueError, match="read-only"):
        result.measurements.value[0] = 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.name = "other"  # type: ignore[misc]  # what must fail


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="nonsense"):
        uavgram.nonsense  # noqa: B018


def loaded_by(code: str) -> set[str]:
    """Top-level packages in sys.modules of a fresh process after `code`."""
    script = f"{code}\nimport sys\nprint(*sorted({{name.split('.')[0] for name in sys.modules}}))"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return set(done.stdout.splitlines()[-1].split())


HEAVY = {"numpy", "scipy", "cv2", "rerun", "pymavlink", "yaml", "pydantic", "pyproj", "jinja2"}


def test_import_loads_nothing_heavy() -> None:
    assert not loaded_by("import uavgram") & (HEAVY | {"cyclopts", "rich"})


def test_help_loads_nothing_heavy() -> None:
    code = "from uavgram.cli import main\nassert main(['--help']) == 0\nmain(['run', '--help'])"
    assert not loaded_by(code) & HEAVY


def test_the_command_line_loads_no_pandas_for_arrow() -> None:
    code = (
        "import sys\nfrom uavgram.cli import main\nsys.argv = ['uavgram', '--version']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "import pyarrow\nassert pyarrow.array([1, 2])[1].as_py() == 2"
    )
    loaded = loaded_by(code)
    assert "pyarrow" in loaded
    assert "pandas" not in loaded
