"""Checks that the generated messages match the .proto file."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the current output of `make proto`."""
    folder = tmp_path_factory.mktemp("proto")
    command = [sys.executable, "-m", "grpc_tools.protoc", f"-I{ROOT}"]
    outputs = [
        f"--python_out={folder}",
        f"--pyi_out={folder}",
        "schema/wire/revolve.proto",
    ]
    subprocess.run([*command, *outputs], cwd=ROOT, check=True, capture_output=True)
    return folder / "schema" / "wire"


@pytest.mark.parametrize("name", ["revolve_pb2.py", "revolve_pb2.pyi"])
def test_generated_code_is_up_to_date(name: str, fresh: Path) -> None:
    committed = (ROOT / "schema" / "wire" / name).read_bytes()
    assert (fresh / name).read_bytes() == committed, "run make proto"
