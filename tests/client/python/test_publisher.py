"""The publisher against a server in the same process, over real gRPC."""

import http.server
import logging
import socket
import threading
import time

import grpc
import numpy as np
import pytest

import throng
from throng import _sender


def crowd_of(count):
    ids = np.arange(1, count + 1)
    positions = np.stack([ids * 0.5, ids * 0.25], axis=1)
    return ids, positions


def test_frame_arrives_as_it_was_published(server):
    with throng.connect(server.url, "hall", channels={"speed": "m/s"}, origin=(10, 20), rate_hz=25,
                        run_id="run", producer="test", seed=9) as pub:
        assert pub.publish(1.5, [3, 4], [(11, 22), (12, 23, )], [0.5, np.nan], speed=[1.0, 2.0])
    start = server.starts[0]
    assert (start.crowd_name, start.run_id, start.producer, start.seed) == ("hall", "run", "test", 9)
    assert (start.origin.x, start.origin.y, start.origin.z) == (10, 20, 0)
    assert [(c.name, c.unit) for c in start.channels] == [("speed", "m/s")]
    assert start.expected_rate_hz == 25 and not start.take_over
    frame, = server.frames
    assert frame.time_us == 1_500_000 and frame.ids.tolist() == [3, 4] and frame.index == 1
    assert frame.positions.tolist() == [[1, 2, 0], [2, 3, 0]]
    assert frame.headings[0] == 0.5 and np.isnan(frame.headings[1])
    assert frame.channels[0].tolist() == [1, 2]
    assert server.half_closes == 1
    stats = pub.stats
    assert (stats.published, stats.sent, stats.applied, stats.dropped, stats.errors) == (1, 1, 1, 0, 0)
    assert stats.viewers == 3 and stats.connections == 1 and not stats.connected and stats.last_error == ""


def test_membership_is_sent_only_when_ids_change(server):
    ids, positions = crowd_of(10)
    with throng.connect(server.url) as pub:
        for step in range(5):
            pub.publish(step * 0.1, ids, positions)
        pub.publish(0.5, ids[::-1], positions[::-1])  # another order is no change
        for step in range(6, 9):
            pub.publish(step * 0.1, ids[:7], positions[:7])
    assert len(server.frames) == 9 and len(server.memberships) == 2
    np.testing.assert_array_equal(server.frames[5].positions, server.frames[4].positions)
    assert len(server.frames[-1].ids) == 7
    assert [frame.index for frame in server.frames] == list(range(1, 10))


def test_frame_over_the_server_limit_is_cut_into_chunks(make_server):
    server = make_server(max_chunk_bytes=20_000)
    ids, positions = crowd_of(2400)  # 19,200 bytes of ids, 48,000 of columns
    with throng.connect(server.url, channels=["density"]) as pub:
        pub.publish(0.0, ids, positions, np.zeros(2400), density=ids)
    frame, = server.frames
    assert frame.chunks > 2 and server.largest_message_bytes <= 20_000
    np.testing.assert_allclose(frame.positions[:, :2], positions)
    np.testing.assert_array_equal(frame.channels[0], ids)


def test_motions_arrive_by_name_by_number_and_for_all(server):
    place = np.zeros((3, 2))
    with throng.connect(server.url, motions=("sit", "dance")) as pub:
        pub.publish(0.0, [1, 2, 3], place, motion=["sit", "", "cheer"])
        pub.publish(1.0, [3, 2, 1], place, motion=["sit", None, "wave"])  # the same ids: rows are put in order
        pub.publish(2.0, [1, 2, 3], place, motion=[2, 0, 1])
        pub.publish(3.0, [1, 2, 3], place, motion="talk")
        pub.publish(4.0, [1, 2, 3], place)
        pub.publish(5.0, [1, 2, 3], [(0, 0), (np.nan, 0), (0, 0)], motion=["sit", "cheer", "wave"])
        pub.publish(6.0, [1, 2, 3], place, motion="")
    told = [dict(zip(frame.ids.tolist(), frame.motions)) for frame in server.frames]
    assert told == [{1: "sit", 2: "", 3: "cheer"}, {1: "wave", 2: "", 3: "sit"}, {1: "dance", 2: "", 3: "sit"},
                    {1: "talk", 2: "talk", 3: "talk"}, {}, {1: "sit", 3: "wave"},
                    {1: "", 2: "", 3: ""}]
    assert pub.stats.errors == 0


@pytest.mark.parametrize("motion", [["sit"], [7, 0], [-1, 0], ["x" * 65, ""]])
def test_motion_that_does_not_fit_is_an_error_not_an_exception(server, motion):
    with throng.connect(server.url) as pub:
        assert not pub.publish(0.0, [1, 2], np.zeros((2, 2)), motion=motion)
    assert pub.stats.errors == 1 and "motion" in pub.stats.last_error


def test_empty_crowd_is_a_frame(server):
    with throng.connect(server.url) as pub:
        assert pub.publish(0.0, [], [])
        assert pub.publish(1.0, [], np.zeros((0, 3)), [])
    assert len(server.frames) == 2 and pub.stats.applied == 2


def test_quaternions_and_directions_have_their_own_columns(server):
    with throng.connect(server.url) as pub:
        pub.publish(0.0, [1], [(0, 0, 1)], [(0, 0, 0, 1)])
        pub.publish(1.0, [1], [(0, 0, 1)], [(0, 1)])
    assert server.frames[0].quaternions.tolist() == [[0, 0, 0, 1]] and server.frames[0].headings is None
    assert server.frames[1].headings[0] == pytest.approx(np.pi / 2)


def test_channels_are_named_by_the_first_frame_unless_told_before(server):
    with throng.connect(server.url) as pub:
        pub.publish(0.0, [1], [(0, 0)], speed=[1.0], group=2)
        pub.publish(1.0, [1], [(0, 0)], group=[3], surprise=[1])
    assert [c.name for c in server.starts[0].channels] == ["speed", "group"]
    assert np.isnan(server.frames[1].channels[0][0]) and server.frames[1].channels[1][0] == 3
    assert pub.stats.errors == 1 and "surprise" in pub.stats.last_error


def test_string_ids_travel_with_their_names(server):
    with throng.connect(server.url) as pub:
        pub.publish(0.0, ["p1", "p2"], [(0, 0), (1, 1)])
    assert server.frames[0].names == ["p1", "p2"]
    assert server.frames[0].ids.tolist() == [throng.hash_id("p1"), throng.hash_id("p2")]


def test_scene_is_sent_before_the_frames_and_once(server):
    with throng.connect(server.url) as pub:
        assert pub.scene(wkt="POLYGON ((0 0, 1 0, 1 1, 0 0))")
        pub.scene(wkt="POLYGON ((0 0, 1 0, 1 1, 0 0))")
        pub.publish(0.0, [1], [(0, 0)])
        pub.publish(0.1, [1], [(0, 0)])
    assert server.environments == ["POLYGON ((0 0, 1 0, 1 1, 0 0))"]


def test_arguments_may_change_right_after_publish(server):
    ids, positions = crowd_of(3)
    with throng.connect(server.url) as pub:
        pub.publish(0.0, ids, positions)
        positions[:] = 99
        ids[:] = [7, 8, 9]
        pub.publish(0.1, ids, positions)
    assert server.frames[0].positions[0].tolist() == [0.5, 0.25, 0]
    assert server.frames[1].ids.tolist() == [7, 8, 9]


def test_broken_stream_is_taken_up_again_with_start_scene_and_membership(server, monkeypatch):
    monkeypatch.setattr(_sender, "FIRST_BACK_OFF_S", 0.01)
    server.break_after = 2
    ids, positions = crowd_of(4)
    with throng.connect(server.url, run_id="r") as pub:
        pub.scene(wkt="POLYGON ((0 0, 1 0, 1 1, 0 0))")
        for step in range(2):
            pub.publish(step * 0.1, ids, positions)
        server.wait(lambda s: len(s.frames) == 2)
        for step in range(2, 4):
            pub.publish(step * 0.1, ids, positions)
        server.wait(lambda s: len(s.starts) == 2)
    assert [start.run_id for start in server.starts] == ["r", "r"]
    assert [start.take_over for start in server.starts] == [False, True]  # the old stream may still be there
    assert len(server.environments) == 2 and len(server.memberships) == 2
    assert server.memberships[1].epoch > server.memberships[0].epoch
    assert server.frames[-1].time_us == 300_000 and pub.stats.connections == 2


def test_last_frame_is_sent_again_when_it_was_lost_with_the_connection(server, monkeypatch):
    monkeypatch.setattr(_sender, "FIRST_BACK_OFF_S", 0.01)
    server.break_after = 1  # read, but never acknowledged
    with throng.connect(server.url) as pub:
        pub.publish(0.5, [1], [(0, 0)])
    assert [frame.stream for frame in server.frames] == [0, 1]
    assert pub.stats.applied == 1


def test_server_that_starts_late_gets_the_newest_frames(make_server, monkeypatch):
    monkeypatch.setattr(_sender, "FIRST_BACK_OFF_S", 0.01)
    monkeypatch.setattr(_sender, "LAST_BACK_OFF_S", 0.05)
    probe = make_server()
    port = probe.port
    probe.stop()
    ids, positions = crowd_of(2)
    with throng.connect(f"127.0.0.1:{port}", queue_frames=3) as pub:
        for step in range(10):
            assert pub.publish(step * 0.1, ids, positions)
        assert pub.stats.queued == 3 and pub.stats.dropped == 7
        server = make_server(port=port)
        server.wait(lambda s: len(s.frames) == 3)
    assert [frame.time_us for frame in server.frames] == [700_000, 800_000, 900_000]


def test_unknown_epoch_makes_the_membership_come_again(server):
    ids, positions = crowd_of(4)
    with throng.connect(server.url) as pub:
        pub.publish(0.0, ids, positions)
        server.wait(lambda s: len(s.frames) == 1)
        server.forget_membership_once = True
        pub.publish(0.1, ids, positions)
        deadline = time.monotonic() + 20
        while pub.stats.unknown_epoch == 0 and time.monotonic() < deadline:
            pass
        pub.publish(0.2, ids, positions)
    assert len(server.memberships) == 2 and server.frames[-1].time_us == 200_000
    assert pub.stats.unknown_epoch == 1 and pub.stats.applied == 2


def test_server_that_stops_reading_never_stalls_publish(server):
    server.reading.clear()
    ids, positions = crowd_of(20_000)
    pub = throng.connect(server.url, queue_frames=4)
    slowest_s = 0.0
    for step in range(200):  # 48 MB, far more than gRPC and the sockets hold
        begin = time.monotonic()
        assert pub.publish(step * 0.1, ids, positions)
        slowest_s = max(slowest_s, time.monotonic() - begin)
    assert pub.stats.dropped > 100 and pub.stats.queued <= 4
    assert slowest_s < 5.0  # stalling would last as long as the server does not read
    server.reading.set()
    assert pub.close(20)
    assert server.frames[-1].time_us == 19_900_000


def test_queue_is_bounded_in_bytes(make_server):
    server = make_server()
    server.stop()
    ids, positions = crowd_of(1000)
    pub = throng.connect(server.url, queue_bytes=30_000)  # 12,000 bytes a frame
    for step in range(10):
        pub.publish(step, ids, positions)
    assert pub.stats.queued == 2 and pub.stats.dropped == 8
    assert not pub.close(0)
    assert pub.stats.dropped == 10


def test_time_that_goes_back_begins_a_new_run(server):
    with throng.connect(server.url, run_id="r") as pub:
        pub.publish(100.0, [1], [(0, 0)])
        pub.publish(99.9, [1], [(0, 0)])   # late, not restarted
        pub.publish(0.0, [1], [(5, 0)])
        pub.publish(0.1, [1], [(6, 0)])
    assert [start.run_id for start in server.starts] == ["r", "r.1"]
    assert [frame.stream for frame in server.frames] == [0, 0, 1, 1]
    assert pub.stats.errors == 0


BAD_CALLS = {
    "nan time": lambda pub: pub.publish(float("nan"), [1], [(0, 0)]),
    "no time": lambda pub: pub.publish(None, [1], [(0, 0)]),
    "endless time": lambda pub: pub.publish(1e300, [1], [(0, 0)]),
    "fewer positions": lambda pub: pub.publish(0, [1, 2], [(0, 0)]),
    "one column": lambda pub: pub.publish(0, [1], [0]),
    "four columns": lambda pub: pub.publish(0, [1], [(0, 0, 0, 0)]),
    "ragged": lambda pub: pub.publish(0, [1, 2], [(0, 0), (1,)]),
    "text positions": lambda pub: pub.publish(0, [1], [("a", "b")]),
    "none positions": lambda pub: pub.publish(0, [1], None),
    "complex": lambda pub: pub.publish(0, [1], [(1j, 0)]),
    "float ids": lambda pub: pub.publish(0, [1.5], [(0, 0)]),
    "no ids": lambda pub: pub.publish(0, None, [(0, 0)]),
    "id is a set of lists": lambda pub: pub.publish(0, [[1]], [(0, 0)]),
    "headings too short": lambda pub: pub.publish(0, [1, 2], [(0, 0), (1, 1)], [0.0]),
    "headings of text": lambda pub: pub.publish(0, [1], [(0, 0)], ["north"]),
    "wkt": lambda pub: pub.scene(wkt="hello"),
    "wkt none text": lambda pub: pub.scene(wkt=3),
}


@pytest.mark.parametrize("name", BAD_CALLS)
def test_bad_arguments_are_logged_once_counted_and_never_raised(server, caplog, name):
    with throng.connect(server.url) as pub, caplog.at_level(logging.WARNING, "throng"):
        assert BAD_CALLS[name](pub) is False
        assert BAD_CALLS[name](pub) is False
        assert pub.stats.errors == 2 and pub.stats.last_error
        assert len(caplog.records) == 1
        assert pub.publish(0.0, [1], [(0, 0)])  # and the next frame is fine
    assert len(server.frames) == 1


def test_bad_channel_is_left_out_and_the_frame_goes_on(server):
    with throng.connect(server.url, channels=["speed"]) as pub:
        pub.publish(0.0, [1, 2], [(0, 0), (1, 1)], speed=[1, 2, 3])
    assert np.isnan(server.frames[0].channels[0]).all() and pub.stats.errors == 1


def test_agents_without_a_finite_position_are_left_out(server):
    with throng.connect(server.url) as pub:
        for step in range(3):
            pub.publish(step, [1, 2, 3], [(0, 0), (np.nan, 0), (2, 2)])
    assert server.frames[0].ids.tolist() == [1, 3] and len(server.memberships) == 1
    assert pub.stats.bad_agents == 3


def test_agents_farther_than_the_server_takes_are_left_out(server):
    with throng.connect(server.url) as pub:
        pub.publish(0.0, [1, 2, 3], [(0, 0), (0, -1.1e7), (1e7, 2)])
    assert server.frames[0].ids.tolist() == [1, 3]
    assert pub.stats.bad_agents == 1 and "within 10000000 m" in pub.stats.last_error


def test_more_agents_than_the_server_takes_are_left_out_with_a_message(make_server):
    server = make_server(max_agents=2)
    with throng.connect(server.url) as pub:
        pub.publish(0.0, [1, 2, 3], [(0, 0)] * 3)
        pub.publish(0.1, [1, 2], [(0, 0)] * 2)
    assert [len(frame.ids) for frame in server.frames] == [2]
    assert "3 agents, the server takes 2" in pub.stats.last_error


@pytest.mark.parametrize("points", [400, 600_000])  # more than the server takes, more than a message may have
def test_agents_are_shown_without_a_site_that_the_server_refuses(server, caplog, points):
    server.max_environment_bytes = 1000
    with throng.connect(server.url) as pub:
        pub.scene("POLYGON ((" + ",".join(f"{x} 0" for x in range(points)) + "))")
        for step in range(400):
            pub.publish(0.1 * step, [1], [(step, 0)])
            with server.changed:
                if server.changed.wait_for(lambda: server.frames, 0.05):
                    break
        pub.scene("POLYGON ((0 0, 9 0, 9 9, 0 0))")
        server.wait(lambda s: s.environments[-1:] == ["POLYGON ((0 0, 9 0, 9 9, 0 0))"])
    assert server.frames
    assert sum("shown without its surroundings" in record.message for record in caplog.records) == 1


def test_refusal_is_logged_with_the_servers_words(server, caplog, monkeypatch):
    monkeypatch.setattr(_sender, "FIRST_BACK_OFF_S", 0.01)
    server.refuse = grpc.StatusCode.ALREADY_EXISTS
    with caplog.at_level(logging.WARNING, "throng"):
        pub = throng.connect(server.url)
        pub.publish(0.0, [1], [(0, 0)])
        server.wait(lambda s: len(s.metadata) == 2)  # it tries again
        assert not pub.close(0.1)
    assert any("ALREADY_EXISTS" in record.message and "refused by the test" in record.message
               for record in caplog.records)


def test_no_server_is_told_with_its_address_and_what_to_do(caplog):
    with socket.socket() as door:  # bound and deaf: nobody else gets its port
        door.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{door.getsockname()[1]}"
        pub = throng.connect(address)
        pub.publish(0.0, [1], [(0, 0)])
        while not pub.stats.last_error:
            pub.publish(0.1, [1], [(0, 0)])
        pub.close(0.1)
    assert f"no throng server answers at {address}; start one with 'throng-server'" in caplog.text


def test_the_pages_address_is_told_from_the_servers(caplog):
    class Page(http.server.BaseHTTPRequestHandler):
        def do_HEAD(self):
            self.send_error(404)

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page) as page:
        threading.Thread(target=page.serve_forever, daemon=True).start()
        address = f"127.0.0.1:{page.server_address[1]}"
        pub = throng.connect(address)
        pub.publish(0.0, [1], [(0, 0)])
        while not pub.stats.last_error:
            pub.publish(0.1, [1], [(0, 0)])
        pub.close(0.1)
        page.shutdown()
    assert f"{address} answers HTTP: that is the address of a page" in caplog.text


def test_a_name_that_no_host_can_have_is_no_page_and_ends_no_thread():
    assert not _sender._answers_http(f"{'a' * 64}.b:7447")


def test_token_goes_along_and_stays_out_of_the_log(server, caplog, monkeypatch):
    monkeypatch.setenv("THRONG_TOKEN", "from-the-environment")
    with throng.connect(server.url) as pub:
        pub.publish(0.0, [1], [(0, 0)])
    with throng.connect(server.url, token="secret-token") as pub:
        pub.publish(0.0, [1], [(0, 0)])
    assert [entry["authorization"] for entry in server.metadata] == ["Bearer from-the-environment",
                                                                     "Bearer secret-token"]
    assert "secret-token" not in caplog.text + repr(pub)


def test_token_may_come_from_a_file(server, tmp_path, monkeypatch):
    path = tmp_path / "tokens"
    monkeypatch.setenv("THRONG_TOKEN_FILE", str(path))
    with pytest.raises(ValueError, match="can't be read"):
        throng.connect(server.url)
    path.write_text("# for the hall\n\n")
    with pytest.raises(ValueError, match="no token"):
        throng.connect(server.url)
    path.write_text("# for the hall\n  token-of-the-file \nanother\n")
    with throng.connect(server.url) as pub:
        pub.publish(0.0, [1], [(0, 0)])
    assert server.metadata[0]["authorization"] == "Bearer token-of-the-file"


def test_url_comes_from_the_environment(server, monkeypatch):
    monkeypatch.setenv("THRONG_URL", server.url)
    with throng.connect() as pub:
        pub.publish(0.0, [1], [(0, 0)])
    assert server.starts[0].crowd_name == "default"


def test_silent_server_is_given_up(server, monkeypatch):
    monkeypatch.setattr(_sender, "FIRST_BACK_OFF_S", 0.01)
    pub = throng.connect(server.url)
    server.reading.clear()
    pub.publish(0.0, [1], [(0, 0)])
    server.wait(lambda s: len(s.metadata) == 1)
    monkeypatch.setattr(_sender, "ACK_TIMEOUT_S", 0.0)
    while len(server.metadata) < 2:
        pub.publish(0.1, [1], [(0, 0)])
    monkeypatch.setattr(_sender, "ACK_TIMEOUT_S", 60.0)
    server.reading.set()
    assert pub.close(20)
    assert pub.stats.applied >= 1


def test_close_without_a_frame_and_twice_is_fine():
    pub = throng.connect("127.0.0.1:1")
    assert pub.close() and pub.close()
    assert pub.publish(0.0, [1], [(0, 0)]) is False


@pytest.mark.parametrize("settings", [
    {"crowd": ""}, {"crowd": "a b"}, {"crowd": "x" * 101}, {"unit": "yard"}, {"unit": -1}, {"unit": float("nan")},
    {"up": "x"}, {"yaw": "north"}, {"handed": "both"}, {"origin": (1,)}, {"origin": (1, float("inf"))},
    {"rate_hz": 0}, {"queue_frames": 0}, {"channels": "speed"}, {"channels": [""]}, {"seed": -1},
    {"url": "ftp://host:1"}, {"url": "host:99999"}, {"url": "host:port"}, {"url": "http://host:1/path"}])
def test_connect_refuses_settings_that_are_wrong_by_themselves(settings):
    with pytest.raises(ValueError):
        throng.connect(**settings)


@pytest.mark.parametrize("url, target, tls", [
    ("host:1", "host:1", False), ("host", "host:7447", False), ("grpc://host:1", "host:1", False),
    ("https://host:443/", "host:443", True), ("[::1]:5", "[::1]:5", False), ("[::1]", "[::1]:7447", False)])
def test_urls_with_and_without_scheme_and_port(url, target, tls):
    endpoint = _sender.Endpoint.parse(url, None, None)
    assert (endpoint.target, endpoint.tls) == (target, tls)
