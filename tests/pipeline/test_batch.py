"""Which projects are meant by folders, patterns and lists."""

from pathlib import Path

import pytest

from uavgram.errors import InputError, UavgramError
from uavgram.pipeline.batch import find_projects


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name in ("2025/a", "2025/b", "2026/c"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "project.yaml").touch()
    return tmp_path


def names(found: tuple[Path, ...]) -> list[str]:
    return [path.parent.name for path in found]


def test_folders_patterns_and_files_each_survey_once(tree: Path) -> None:
    assert names(find_projects([tree])) == ["a", "b", "c"]
    assert names(find_projects([tree / "2026", tree / "*" / "b", tree])) == ["c", "b", "a"]
    assert names(find_projects([tree / "**" / "project.yaml"])) == ["a", "b", "c"]
    assert names(find_projects([tree / "2025" / "b" / "project.yaml"])) == ["b"]


def test_a_list_names_them_line_by_line(tree: Path) -> None:
    (tree / "mine.txt").write_text("# this year\n2026/c\n\n2025/a/project.yaml  # old\n")

    assert names(find_projects([tree / "mine.txt"])) == ["c", "a"]


@pytest.mark.parametrize("line", ["2027/x", "mine.txt", "2027/*"])
def test_a_wrong_line_of_a_list_is_named(tree: Path, line: str) -> None:
    (tree / "mine.txt").write_text(f"2026/c\n{line}\n")

    with pytest.raises(InputError, match=r"mine\.txt:2: ") as raised:
        find_projects([tree / "mine.txt"])
    assert line in str(raised.value)


def test_nothing_found_is_no_batch(tree: Path) -> None:
    (tree / "empty").mkdir()
    for wanted in ([tree / "empty"], [tree / "x" / "*"], [tree / "none.yaml"]):
        with pytest.raises(InputError):
            find_projects(wanted)
    with pytest.raises(UavgramError, match="no survey"):
        find_projects([])
