import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

from ingest_server import IngestServer  # noqa: E402


@pytest.fixture
def server():
    running = IngestServer()
    yield running
    running.stop()


@pytest.fixture
def make_server():
    """Starts servers with settings of their own and stops them all at the end."""
    running = []

    def make(**settings) -> IngestServer:
        running.append(IngestServer(**settings))
        return running[-1]

    yield make
    for one in running:
        one.stop()
