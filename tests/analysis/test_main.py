"""Commands whose libraries are not installed name the command that installs them."""

import os
import subprocess
import sys

import pytest

HIDE = """
import sys
sys.modules[sys.argv[1]] = None
from analysis.__main__ import main
from schema.errors import RevolveError
try:
    main(sys.argv[2:])
except RevolveError as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("library", "words", "extra"),
    [
        ("PIL", ("robot render", "best.yaml", "best.png"), "pictures"),
        ("PIL", ("view", ".", "--save", "arena.gif"), "pictures"),
        ("rerun", ("view", ".", "--save", "run.rrd"), "view"),
        ("plotnine", ("analyze", "run"), "analysis"),
    ],
)
def test_a_missing_library_is_named_with_its_extra(
    library: str, words: tuple[str, ...], extra: str
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", HIDE, library, *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert f"[{extra}]" in done.stdout
    assert "install" in done.stdout


@pytest.mark.parametrize(
    ("module", "command"),
    [("analysis.__main__", "analyze"), ("revolve.cli.reevaluate", "robustness")],
)
def test_the_backend_of_a_notebook_does_not_stop_an_analysis(
    module: str, command: str
) -> None:
    """Its name is refused by matplotlib where the notebook's package is missing."""
    script = f"from {module} import main; main([{command!r}, 'nowhere'])"
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "MPLBACKEND": "module://matplotlib_inline.backend_inline"},
    )
    assert "RunFolderError: nowhere: no such folder" in done.stderr


def test_the_renderer_of_an_analysis_is_chosen_before_mujoco_is_imported() -> None:
    """Later choices have no effect, and robots would be drawn ray by ray."""
    script = "import sys; from analysis.__main__ import main; import os\ntry:\n"
    script += "    main(['analyze', 'nowhere'])\n"
    script += "finally:\n    print('mujoco' in sys.modules, 'MUJOCO_GL' in os.environ)"
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=False,
        env={name: os.environ[name] for name in os.environ if name != "MUJOCO_GL"},
    )
    assert done.stdout == "True True\n"
