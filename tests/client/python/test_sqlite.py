"""A trajectory file beside the live crowd."""

import sqlite3

import numpy as np
import pytest

import throng
from throng.sqlite import SqliteTee


def rows_of(path, query):
    with sqlite3.connect(path) as database:
        return database.execute(query).fetchall()


def test_file_has_what_was_published(server, tmp_path):
    path = tmp_path / "run.sqlite"
    path.write_text("of an earlier run")
    with throng.connect(server.url, origin=(1000, 0), queue_frames=100) as pub, SqliteTee(pub, path, fps=10) as tee:
        tee.scene("POLYGON ((0 0, 2000 0, 2000 9, 0 9, 0 0))")
        for step in range(12):
            assert tee.publish(5 + step * 0.1, ["anna", "bo"], [[1000 + step, 1], [1001, 2]], [0.0, np.nan], speed=[1, 2])
        assert tee.publish(6.1, ["anna"], [[0, 0]]), "published again, not written"
    assert server.starts[0].expected_rate_hz == pytest.approx(10)
    assert len(server.frames) == 13
    assert rows_of(path, "SELECT frame, id, pos_x, pos_y, ori_x, ori_y FROM trajectory_data WHERE frame = 11") == [
        (11, 1, 1011.0, 1.0, 1.0, 0.0), (11, 2, 1001.0, 2.0, 0.0, 0.0)]
    assert len(rows_of(path, "SELECT * FROM trajectory_data")) == 24
    assert dict(rows_of(path, "SELECT key, value FROM metadata"))["fps"] == "10.0"


def test_jupedsim_reads_the_file(server, tmp_path):
    jps = pytest.importorskip("jupedsim", reason="jupedsim is not installed")
    path = tmp_path / "run.sqlite"
    with throng.connect(server.url) as pub, SqliteTee(pub, path, fps=25) as tee:
        for step in range(5):
            tee.publish(step / 25, np.arange(3), np.full((3, 2), step))
    recording = jps.Recording(str(path))
    assert recording.num_frames == 5 and recording.fps == 25
    assert [agent.position for agent in recording.frame(4).agents] == [(4.0, 4.0)] * 3


def test_simulation_goes_on_when_the_disk_does_not(server, tmp_path):
    path = tmp_path / "run.sqlite"
    with throng.connect(server.url) as pub:
        tee = SqliteTee(pub, path, fps=10)
        tee._file.execute("DROP TABLE frame_data")
        assert tee.publish(0, [1], [[0, 0]]) and tee.publish(0.1, [1], [[0, 0]])
        assert "run.sqlite ends here" in pub.stats.last_error
        tee.close()
    assert len(server.frames) == 2


def test_bad_settings_raise_before_the_simulation_begins(server, tmp_path):
    with throng.connect(server.url) as pub:
        with pytest.raises(ValueError, match="fps"):
            SqliteTee(pub, tmp_path / "run.sqlite", fps=0)
        with pytest.raises(sqlite3.OperationalError):
            SqliteTee(pub, tmp_path / "no/folder/run.sqlite", fps=10)
