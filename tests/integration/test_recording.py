"""What throng-server --record keeps, also when it is killed in the middle of it."""

import json
import re
import subprocess
import time

import numpy as np
import pytest
import throng

from conftest import BUILD


@pytest.fixture
def server(tmp_path):
    """A server with a page's worth of flags; `kill` is a real kill -9."""
    running = []

    def start(*flags, listen="127.0.0.1:0"):
        process = subprocess.Popen(
            [str(BUILD / "bin/throng-server"), "--listen", listen, "--log-level", "off", *map(str, flags)],
            stdout=subprocess.PIPE, text=True)
        running.append(process)
        for line in process.stdout:
            if ready := re.match(r"throng-server ready on (\S+),", line):
                return process, ready[1]
        pytest.fail("the server did not start")

    yield start
    for process in running:
        process.kill()
        process.wait()


def walk(url, frames, agents=300, noise_m=0.0):
    """Publishes people who walk until as many frames were applied; returns where they were."""
    ids = np.arange(1, agents + 1)
    rng = np.random.default_rng(4)
    start = rng.uniform(0, 40, (agents, 2))
    sent = {}
    with throng.connect(url, "hall", channels=["mood"], queue_frames=frames) as crowd:
        for step in range(frames):
            sent[step] = start + (0.1 * step, 0.02 * step) + rng.normal(0, noise_m, (agents, 2))
            crowd.publish(t=step * 0.1, ids=ids, positions=sent[step], mood=np.full(agents, step, np.float32))
        assert crowd.close(60.0), crowd.stats
        assert crowd.stats.applied == frames
    return sent


def crowd_at(program, url):
    """The only crowd of a server, or nothing."""
    crowds = json.loads(program("throng", "crowds", "--json", THRONG_URL=url).stdout)["crowds"]
    numbers = ("frames", "recorded_frames", "unrecorded_frames", "oldest_time_us")
    return {**crowds[0], **{name: int(crowds[0][name]) for name in numbers}} if crowds else {}


def until(condition):
    end = time.monotonic() + 60  # only bounds how long a broken server hangs
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_killed_server_leaves_every_frame_that_was_recorded(server, program, tmp_path):
    folder = tmp_path / "runs"
    process, url = server("--record", folder)
    sent = walk(url, 60)
    until(lambda: crowd_at(program, url)["recorded_frames"] == 60)
    assert crowd_at(program, url)["unrecorded_frames"] == 0
    process.kill()  # SIGKILL
    process.wait()

    [part] = folder.iterdir()
    assert re.fullmatch(r"hall\.\d{8}T\d{6}Z\.0001\.trec", part.name)
    info = json.loads(program("throng", "info", part, "--json").stdout)
    assert info["format"] == "throng-recording"
    assert (info["frames"], info["agents"]) == (60, 300)

    # Torn in the middle of the last frame, as a kill within the write leaves it: one frame less.
    torn = tmp_path / "torn.trec"
    torn.write_bytes(part.read_bytes()[:-7])
    done = program("throng", "convert", torn, "torn.csv")
    assert done.returncode == 0, done.stderr
    assert "cut short" in done.stderr
    rows = np.genfromtxt(tmp_path / "torn.csv", delimiter=",", names=True)
    assert len(rows) == 59 * 300
    for step in (0, 31, 58):
        of_step = rows[np.isclose(rows["time_s"], step * 0.1)]
        at = of_step[np.argsort(of_step["id"])]
        assert np.abs(np.stack([at["x_m"], at["y_m"]], axis=1) - sent[step]).max() < 1e-4
        assert (at["mood"] == step).all()


def test_killed_server_has_its_crowd_again_and_the_producer_goes_on(server, program, tmp_path):
    flags = ("--record", tmp_path / "runs", "--record-sync-ms", "50")
    process, url = server(*flags)
    ids, at = np.arange(1, 51), np.zeros((50, 2))
    with throng.connect(url, "hall") as crowd:
        for step in range(40):
            crowd.publish(t=step * 0.1, ids=ids, positions=at + 0.1 * step)
        until(lambda: crowd_at(program, url).get("recorded_frames") == 40)
        process.kill()  # SIGKILL, under the producer
        process.wait()
        process, _ = server(*flags, listen=url)
        back = crowd_at(program, url)
        assert (back["frames"], back["oldest_time_us"], back["agents"]) == (40, 0, 50), "before anybody sends"
        step = 40
        while crowd_at(program, url)["frames"] < 50:
            crowd.publish(t=step * 0.1, ids=ids, positions=at + 0.1 * step)
            step += 1
            time.sleep(0.01)
        now = crowd_at(program, url)
        assert now["oldest_time_us"] == 0, "the history goes back to before the kill"
        assert crowd.close(60.0), crowd.stats
    process.terminate()
    assert process.wait() == 0
    first = min((tmp_path / "runs").iterdir())
    info = json.loads(program("throng", "info", first, "--json").stdout)
    assert info["frames"] >= 50, "one recording from before the kill on"

    _, url = server(*flags, "--fresh")
    assert crowd_at(program, url) == {}


def test_recording_is_played_again_by_publish(server, program, tmp_path):
    process, url = server("--record", tmp_path / "runs")
    walk(url, 20, agents=50)
    process.terminate()
    assert process.wait() == 0
    [part] = (tmp_path / "runs").iterdir()

    _, again = server()
    done = program("throng", "publish", part, "--crowd", "again", "--rate", "20", THRONG_URL=again)
    assert done.returncode == 0, done.stderr
    assert "20 frames published, 20 applied, 0 dropped" in done.stderr
    [crowd] = json.loads(program("throng", "crowds", "--json", THRONG_URL=again).stdout)["crowds"]
    assert crowd["agents"] == 50


def test_stopped_server_writes_all_that_waits_and_what_agents_do(server, program, tmp_path):
    process, url = server("--record", tmp_path / "runs", "--record-sync-ms", "0")
    ids, at = np.arange(1, 3001), np.random.default_rng(2).uniform(0, 90, (3000, 2))
    with throng.connect(url, "hall", queue_frames=60) as crowd:
        for step in range(60):
            motion = np.where(ids % 3 == 0, "sit" if step < 30 else "wave", "")
            crowd.publish(t=step * 0.1, ids=ids, positions=at, motion=motion)
        assert crowd.close(60.0), crowd.stats
    process.terminate()
    assert process.wait() == 0
    [part] = (tmp_path / "runs").iterdir()
    info = json.loads(program("throng", "info", part, "--json").stdout)
    assert (info["frames"], info["motions"]) == (60, ["sit", "wave"])


def test_recording_keeps_to_its_limit(server, tmp_path):
    process, url = server("--record", tmp_path / "runs", "--record-mib", "1")
    walk(url, 100, agents=4000, noise_m=0.05)
    process.terminate()  # writes what waits
    assert process.wait() == 0
    parts = sorted((tmp_path / "runs").iterdir())
    assert len(parts) > 2
    assert not parts[0].name.endswith(".0001.trec"), "the oldest was removed"
    assert sum(part.stat().st_size for part in parts) <= 1 << 20


def test_table_that_is_out_of_order_far_down_is_sorted_and_goes_on(server, program, tmp_path):
    rows = "".join(f"{step / 10:.1f},{agent},{agent % 50},{agent // 50}\n" for step in range(150) for agent in range(1000))
    (tmp_path / "late.csv").write_text("time_s,id,x_m,y_m\n" + rows + "1.0,5000,1,1\n")
    _, url = server()
    done = program("throng", "publish", "late.csv", "--crowd", "late", "--rate", "20", THRONG_URL=url)
    assert done.returncode == 0, done.stderr
    assert "late.csv, line 150002" in done.stderr and "it is sorted now" in done.stderr
    [crowd] = json.loads(program("throng", "crowds", "--json", THRONG_URL=url).stdout)["crowds"]
    assert (crowd["agents"], int(crowd["newest_time_us"])) == (1000, 14_900_000)


def test_folder_that_cannot_be_written_is_refused_at_once(program, tmp_path):
    (tmp_path / "file").write_text("no folder")
    done = program("throng-server", "--listen", "127.0.0.1:0", "--record", tmp_path / "file")
    assert done.returncode == 3
    assert "--record" in done.stderr


def test_site_of_a_published_file_is_kept_with_it(server, program, tmp_path):
    (tmp_path / "walk.csv").write_text("time,id,x,y\n0,1,1,1\n1,1,2,1\n")
    (tmp_path / "hall.scenario").write_text(json.dumps({"scenario": {"topography": {"attributes": {
        "bounds": {"x": 0, "y": 0, "width": 9, "height": 9}, "boundingBoxWidth": 0.5}}}}))
    process, url = server("--record", tmp_path / "runs")
    done = program("throng", "publish", "walk.csv", "--crowd", "hall", "--environment", "hall.scenario", "--rate", "100",
                   THRONG_URL=url)
    assert done.returncode == 0, done.stderr
    until(lambda: crowd_at(program, url)["recorded_frames"] == 2)
    (tmp_path / "bad.json").write_text("{}")
    bad = program("throng", "publish", "walk.csv", "--crowd", "bad", "--environment", "bad.json", "--wait", "2", THRONG_URL=url)
    assert bad.returncode != 0 and "neither" in bad.stderr
    process.kill()
    process.wait()
    [part] = (tmp_path / "runs").glob("hall.*")
    assert json.loads(program("throng", "info", part, "--json").stdout)["walkable_area"]
