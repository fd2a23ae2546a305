"""docs/architecture.md and its picture agree with the source files."""

import re
from pathlib import Path

import pytest

from docs.architecture import PICTURE, draw
from docs.architecture_rooms import ROOMS, ROOT

PAGE = ROOT / "docs" / "architecture.md"
MOST_STEPS = 15


def sections() -> dict[str, str]:
    """Return the text of each section of the page by its title."""
    parts = re.split(r"^#+ (.+)$", PAGE.read_text("utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def step_lists(text: str) -> list[list[int]]:
    """Return the numbers of the steps of each list in a text."""
    numbers = [int(found) for found in re.findall(r"^(\d+)\. ", text, re.MULTILINE)]
    starts = [index for index, number in enumerate(numbers) if number == 1]
    return [
        numbers[start:end]
        for start, end in zip(starts, [*starts[1:], len(numbers)], strict=True)
    ]


def code_spans(text: str) -> list[str]:
    """Return the code spans of a text, without its code blocks."""
    return re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL))


def paths(text: str) -> list[str]:
    """Return the paths of files and folders that a text names in code spans."""
    tops = "|".join((*ROOMS, "tests", "docs"))
    return [
        span.rstrip("/")
        for span in code_spans(text)
        if re.fullmatch(rf"(?:{tops})/[\w./-]+|\w+\.(?:py|toml|md)|Makefile", span)
    ]


@pytest.mark.slow
def test_picture_is_up_to_date_with_the_imports() -> None:
    drawn = draw()
    assert drawn == draw()
    assert PICTURE.read_text("utf-8") == drawn, "run python -m docs.architecture"


def test_files_named_on_the_page_exist() -> None:
    named = paths(PAGE.read_text("utf-8"))
    assert len(named) > 60
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_names_on_the_page_exist_in_the_code() -> None:
    spans = code_spans(PAGE.read_text("utf-8"))
    named = {span for span in spans if re.fullmatch(r"[A-Za-z_]\w*", span)}
    assert len(named) > 60
    files = [
        path for top in (*ROOMS, "tests", "docs") for path in (ROOT / top).rglob("*.py")
    ]
    texts = [
        path.read_text("utf-8") for path in files if path.name != Path(__file__).name
    ]
    known = {word for text in texts for word in re.findall(r"\w+", text)}
    assert named - known == {"union_by_name"}  # an option of DuckDB


def test_both_births_have_at_most_fifteen_steps() -> None:
    for title in ("One off-line birth", "One on-line birth"):
        (steps,) = step_lists(sections()[title])
        assert steps == list(range(1, len(steps) + 1))
        assert 5 < len(steps) <= MOST_STEPS


def test_no_list_has_more_than_fifteen_steps() -> None:
    lists = step_lists(PAGE.read_text("utf-8"))
    assert len(lists) > 2
    assert [steps for steps in lists if len(steps) > MOST_STEPS] == []


def test_every_step_of_a_birth_names_a_file() -> None:
    for title in ("One off-line birth", "One on-line birth"):
        steps = re.split(r"^\d+\. ", sections()[title], flags=re.MULTILINE)[1:]
        assert [step for step in steps if not paths(step)] == []


def test_every_package_has_a_line_on_the_page() -> None:
    packages = {
        folder.relative_to(ROOT).as_posix()
        for room in ROOMS
        for folder in Path(ROOT, room).iterdir()
        if (folder / "__init__.py").is_file()
    }
    page = PAGE.read_text("utf-8")
    listed = set(re.findall(r"^\| `([\w/]+)/` \|", page, re.MULTILINE))
    assert packages - listed == set()


def test_picture_is_on_the_page() -> None:
    assert "(pictures/architecture.svg)" in PAGE.read_text("utf-8")
