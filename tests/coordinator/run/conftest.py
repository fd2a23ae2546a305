"""A run of an arena that several files compare theirs with."""

from pathlib import Path

import pytest

from tests.coordinator.run.test_arena_resume import run


@pytest.fixture(scope="session")
def calm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an undisturbed run."""
    path = tmp_path_factory.mktemp("calm") / "run"
    assert run(path)
    return path
