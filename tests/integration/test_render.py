"""throng-render from the outside: pictures, shards, resuming, exit codes."""

import hashlib
import json
import os

import pytest

SMALL = ("--size", "320x180", "--vertex-budget", "20000")
SYNTHETIC = ("--synthetic", 60, "--synthetic-seconds", 2, "--fps", 5, *SMALL)

CSV = "time,id,x,y\n" + "".join(
    f"{step / 10:.1f},{agent},{agent + step * 0.13:.3f},{agent % 3}\n"
    for step in range(11)
    for agent in range(1, 6)
)


def digests(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()}


@pytest.fixture
def csv(tmp_path):
    path = tmp_path / "walk.csv"
    path.write_text(CSV)
    return path


def test_three_shards_give_the_bytes_of_one(program, tmp_path):
    whole = program("throng-render", *SYNTHETIC, "-o", "one/####.png", "--threads", 1)
    assert whole.returncode == 0, whole.stderr
    for shard in (1, 2, 3):
        part = program("throng-render", *SYNTHETIC, "-o", "three/####.png", "--shard", f"{shard}/3")
        assert part.returncode == 0, part.stderr
    one = digests(tmp_path / "one")
    assert len(one) == 11
    assert one == digests(tmp_path / "three")
    assert len(set(one.values())) == 11, "people walk, so no two pictures are equal"


def test_a_file_becomes_pictures_and_stats(program, csv, tmp_path):
    result = program("throng-render", csv, "-o", "out/%03d.jpg", "--stats", "stats.jsonl", "--fps", 10, *SMALL)
    assert result.returncode == 0, result.stderr
    assert sorted(path.name for path in (tmp_path / "out").iterdir())[::5] == ["001.jpg", "006.jpg", "011.jpg"]
    assert all(path.read_bytes()[:2] == b"\xff\xd8" for path in (tmp_path / "out").iterdir())
    lines = [json.loads(line) for line in (tmp_path / "stats.jsonl").read_text().splitlines()]
    assert [line["frame"] for line in lines] == list(range(1, 12))
    assert all(line["agents"] == 5 and line["visible"] == 5 for line in lines)
    assert all(0 < line["vertices"] <= 20000 for line in lines)


def test_a_file_becomes_a_video(program, csv, tmp_path):
    result = program("throng-render", csv, "-o", "walk.mp4", *SMALL)
    assert result.returncode == 0, result.stderr
    assert b"ftyp" in (tmp_path / "walk.mp4").read_bytes()[:64]


def test_skip_existing_renders_only_what_is_missing(program, csv, tmp_path):
    command = ("throng-render", csv, "-o", "out/#.png", "--frames", "1-4", "--skip-existing", *SMALL)
    assert program(*command).returncode == 0
    before = digests(tmp_path / "out")
    (tmp_path / "out/3.png").unlink()
    kept = (tmp_path / "out/2.png").stat().st_mtime_ns
    again = program(*command)
    assert again.returncode == 0
    assert "1 written, 3 there already" in again.stderr
    assert digests(tmp_path / "out") == before
    assert (tmp_path / "out/2.png").stat().st_mtime_ns == kept


def test_camera_file_moves_the_view(program, csv, tmp_path):
    (tmp_path / "camera.json").write_text(
        json.dumps({"keys": [{"time_s": 0, "eye": [3, -8, 2], "target": [3, 1, 1]},
                             {"time_s": 1, "eye": [3, -8, 9], "target": [3, 1, 1]}]}))
    for camera in ("overview", "camera.json"):
        assert program("throng-render", csv, "-o", f"{camera[:3]}/#.png", "--camera", camera, "--frames", "1,25",
                       *SMALL).returncode == 0
    assert not set(digests(tmp_path / "cam").values()) & set(digests(tmp_path / "ove").values())


def test_several_cameras_in_one_pass_give_the_bytes_of_each_alone(program, csv, tmp_path):
    words = ("overview", "top", "orbit", "follow:1")
    cameras = [argument for word in words for argument in ("--camera", word)]
    assert program("throng-render", csv, "-o", "all/{camera}/#.png", *cameras, "--frames", "1,9", *SMALL).returncode == 0
    for word in words:
        name = word.replace(":", "-")
        assert program("throng-render", csv, "-o", f"one/{name}/#.png", "--camera", word, "--frames", "1,9",
                       *SMALL).returncode == 0
        assert digests(tmp_path / "all" / name) == digests(tmp_path / "one" / name)
        assert len(digests(tmp_path / "all" / name)) == 2


def test_one_picture_needs_no_number(program, tmp_path):
    assert program("throng-render", "--synthetic", 5, "-o", "one.png", "--frames", 3, *SMALL).returncode == 0
    assert [path.name for path in tmp_path.glob("*.png")] == ["one.png"]


@pytest.mark.parametrize(
    "arguments, code, words",
    [
        (("-o", "out/#.png"), 2, "either a trajectory file or --synthetic"),
        (("--synthetic", 5, "-o", "out.png"), 2, "names one picture"),
        (("--synthetic", 5, "-o", "#.png", "--camera", "top", "--camera", "orbit"), 2, "{camera}"),
        (("--synthetic", 5, "-o", "{camera}#.png", "--camera", "top", "--camera", "top"), 2, "called 'top'"),
        (("--synthetic", 5, "-o", "#.png", "--overlay", "time,clock"), 2, "'clock'"),
        (("--synthetic", 5, "-o", "#_#.png"), 2, "more than one place"),
        (("--synthetic", 5, "-o", "out/#.gif"), 2, ".png, .jpg or .mp4"),
        (("--synthetic", 5, "-o", "#.png", "--size", "0x5"), 2, "--size"),
        (("--synthetic", 5, "-o", "#.png", "--size", "nanxnan"), 2, "--size"),
        (("--synthetic", 5, "-o", "#.png", "--frames", "5-1"), 2, "--frames"),
        (("--synthetic", 5, "-o", "#.png", "--shard", "4/3"), 2, "--shard"),
        (("--synthetic", 5, "-o", "a.mp4", "--shard", "1/3"), 2, "a video is one file"),
        (("--synthetic", 5, "-o", "#.png", "--cast", "nowhere"), 3, "nowhere"),
        (("--synthetic", 5, "-o", "#.png", "--camera", "nowhere.json"), 3, "nowhere.json"),
        (("nowhere.sqlite", "-o", "#.png"), 3, "nowhere.sqlite"),
        (("--synthetic", 5, "-o", "/proc/none/#.png", "--frames", "1"), 5, "/proc/none"),
        (("--synthetic", 5, "-o", "#.png", "--no-such-flag"), 2, "--no-such-flag"),
    ],
)
def test_bad_input_is_one_clear_error_with_its_exit_code(program, arguments, code, words):
    result = program("throng-render", *arguments)
    assert result.returncode == code, result.stderr
    assert words in result.stderr


def test_a_name_that_is_not_utf8_is_only_a_name(program, tmp_path):
    result = program("throng-render", "--synthetic", 5, "-o", os.fsdecode(b"\xe4#.png"), "--frames", "1",
                     "--stats", "stats.jsonl", "-q", *SMALL)
    assert result.returncode == 0, result.stderr
    assert json.loads((tmp_path / "stats.jsonl").read_text())["frame"] == 1


def test_a_file_that_breaks_off_is_refused_before_the_first_picture(program, tmp_path):
    (tmp_path / "broken.csv").write_text(CSV + "1.1,1,oops,2\n")
    result = program("throng-render", "broken.csv", "-o", "out/#.png", "--fps", 10, *SMALL)
    assert result.returncode == 3
    assert "broken.csv" in result.stderr and "oops" in result.stderr
    assert not (tmp_path / "out").exists()


COVERED = {
    "juelich_bottleneck_040_c_56_h-.txt": (),
    "juelich_bidirectional_bi_corr_400_b_03.txt": (),
    "juelich_corridor_uo-100-180-180.txt": ("--source-fps", 16, "--source-unit", "cm"),
    "madras_lyon_festival_1A.txt": (),
    "jupedsim_demo.sqlite": (),
    "jupedsim_sib2023_2500_agents.sqlite": (),
    "ucy_zara01_obsmat.txt": (),
    "vadere_bottleneck_postvis.traj": (),
    "pathfinder_room.csv": (),
    "crowdit.csv.gz": (),
    "sumo_60_persons.fcd.xml": (),
    "sumo_grid_4700_persons.fcd.xml.gz": (),
    "rvo2_blocks_100_agents.txt": (),
    "menge_4square_100_agents_v2.1.scb": (),
    "menge_tradeshow_1025_agents_v2.1.scb": (),
    "menge_office_48_agents_v1.0.scb": ("--source-fps", 10),
}


@pytest.mark.parametrize("name", COVERED)
def test_real_trajectories_become_pictures(program, data_dir, tmp_path, name):
    path = data_dir / "trajectories" / name
    result = program("throng-render", path, *COVERED[name], "-o", "out/####.png", "--frames", "1,10", *SMALL,
                     "--stats", "stats.jsonl", "--fps", 2)
    assert result.returncode == 0, result.stderr
    assert len(list((tmp_path / "out").iterdir())) == 2
    lines = [json.loads(line) for line in (tmp_path / "stats.jsonl").read_text().splitlines()]
    assert any(line["visible"] > 0 for line in lines)


def test_a_file_without_rate_or_unit_says_how_to_give_them(program, data_dir):
    path = data_dir / "trajectories" / "juelich_corridor_uo-100-180-180.txt"
    result = program("throng-render", path, "-o", "out/####.png")
    assert result.returncode == 3
    assert "--source-fps" in result.stderr


def test_name_of_a_followed_agent_makes_a_safe_path(program, tmp_path):
    (tmp_path / "names.csv").write_text("time,id,x,y\n0,../a/b#1,1,1\n1,../a/b#1,2,1\n")
    result = program("throng-render", "names.csv", "-o", "out/{camera}/#.png", "--camera", "follow:../a/b#1",
                     "--frames", "1", *SMALL)
    assert result.returncode == 0, result.stderr
    assert [str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.png")] == ["out/follow-.._a_b_1/1.png"]


def test_nobody_to_follow_is_an_error_that_names_somebody(program, tmp_path):
    (tmp_path / "two.csv").write_text("time,id,x,y\n0,7,1,1\n0,9,3,1\n1,7,2,1\n1,9,4,1\n")
    (tmp_path / "camera.json").write_text('{"follow": {"agent": 8}}')
    for camera in "follow:8", "camera.json":
        result = program("throng-render", "two.csv", "-o", "out/#.png", "--camera", camera, *SMALL)
        assert result.returncode == 3
        assert f"--camera {camera}: two.csv has no such agent among its 2; the first of them is 7" in result.stderr
        assert not (tmp_path / "out").exists()


SITES = {
    "hall.wkt": "POLYGON ((-2 -2, 12 -2, 12 6, -2 6, -2 -2), (3 4, 5 4, 5 5, 3 5, 3 4))",
    "hall.geojson": json.dumps({"type": "FeatureCollection", "features": [
        {"type": "Feature", "properties": {}, "geometry": {
            "type": "Polygon", "coordinates": [[[-2, -2], [12, -2], [12, 6], [-2, 6], [-2, -2]]]}},
        {"type": "Feature", "properties": {"type": "obstacle"}, "geometry": {
            "type": "Polygon", "coordinates": [[[3, 4], [5, 4], [5, 5], [3, 5], [3, 4]]]}}]}),
    "hall.scenario": json.dumps({"scenario": {"topography": {
        "attributes": {"bounds": {"x": -2.5, "y": -2.5, "width": 15, "height": 9}, "boundingBoxWidth": 0.5,
                       "bounded": True},
        "obstacles": [{"shape": {"type": "RECTANGLE", "x": 3, "y": 4, "width": 2, "height": 1}}]}}}),
}


def test_a_site_is_the_same_in_every_format(program, csv, tmp_path):
    pictures = {"none": program("throng-render", csv, "-o", "none.png", "--frames", "1", *SMALL)}
    for name, text in SITES.items():
        (tmp_path / name).write_text(text)
        pictures[name] = program("throng-render", csv, "-o", f"{name}.png", "--environment", name, "--frames", "1", *SMALL)
    assert [done.returncode for done in pictures.values()] == [0] * 4, [done.stderr for done in pictures.values()]
    # The corners may be written in another order, so pixels at edges may differ: sizes are close, walls are there.
    sizes = {path.name: path.stat().st_size for path in tmp_path.glob("*.png")}
    walls = [size for name, size in sizes.items() if name.startswith("hall")]
    assert max(walls) < 1.02 * min(walls) and min(walls) != sizes["none.png"], sizes


def test_site_that_is_none_is_refused_by_name(program, csv, tmp_path):
    (tmp_path / "bad.geojson").write_text('{"type": "Point", "coordinates": [1, 2]}')
    result = program("throng-render", csv, "-o", "one.png", "--environment", "bad.geojson", "--frames", "1", *SMALL)
    assert result.returncode == 3
    assert "bad.geojson" in result.stderr and "walkable" in result.stderr
