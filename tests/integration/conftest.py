"""Where the built programs, the built-in cast and the shared data are."""

import os
import pathlib
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("THRONG_BUILD_DIR", ROOT / "build/release"))
DATA = pathlib.Path(os.environ.get("THRONG_DATA_DIR", ROOT / "../shared/data")).resolve()


@pytest.fixture(scope="session")
def data_dir():
    if not DATA.is_dir():
        pytest.skip(f"no shared data in {DATA.name} (set THRONG_DATA_DIR)")
    return DATA


@pytest.fixture
def program(tmp_path):
    """Runs a built program; returns the completed process with text output."""

    def run(name, *arguments, timeout=300, **environment):
        return subprocess.run(
            [str(BUILD / "bin" / name), *map(str, arguments)],
            cwd=tmp_path,
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            timeout=timeout,
        )

    return run
