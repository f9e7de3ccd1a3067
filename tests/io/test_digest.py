from __future__ import annotations

from pathlib import Path

import pytest

from uavgram.errors import InputError
from uavgram.io.inputs import digest_file, digest_inputs


def test_the_digest_is_that_of_fips_180(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"abc")

    digest = digest_file(path)
    # NIST FIPS 180-2, appendix B.1
    assert digest.sha256 == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert digest.size_bytes == 3
    assert digest.path == str(path)


def test_paths_inside_the_project_are_relative_and_each_file_stands_once(tmp_path: Path) -> None:
    inside, outside = tmp_path / "project" / "photos" / "a.jpg", tmp_path / "camera.yaml"
    inside.parent.mkdir(parents=True)
    inside.touch()
    outside.touch()

    digests = digest_inputs([inside, outside, inside], tmp_path / "project")
    assert [d.path for d in digests] == ["photos/a.jpg", str(outside)]


def test_a_missing_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        digest_file(tmp_path / "absent")
