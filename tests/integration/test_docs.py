"""Every command that README and the page of results show is run here, or says which test runs it.

Pictures are made small and recordings short by options that are appended or replaced; nothing else of a command is
changed. Of a command that README gains and this file does not know yet only the options are checked.
"""

import json
import math
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys

import pytest

from conftest import BUILD, ROOT

README = "".join((ROOT / name).read_text() for name in ("README.md", "tests/bench/results/README.md"))
SMALL = "--size 320x180 --vertex-budget 20000"


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def commands():
    """The commands of README's shell blocks and those it names within a sentence."""
    found = []
    for block in blocks("sh"):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(re.sub(r"(^|\s)#\s.*", "", line))
            if words:
                found.append(shlex.join(word for word in words if word != "&"))
    prose = re.sub(r"^```.*?^```$", "", README, flags=re.MULTILINE | re.DOTALL)
    for code in re.findall(r"`([^`]+)`", prose):
        code = " ".join(code.split())
        if re.match(r"(throng(-\w+)? \S|cmake --build|source |export )", code) and not re.search(r"FILE|--shard i", code):
            found.append(code)
    return list(dict.fromkeys(found))


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the files that README's commands name."""
    folder = tmp_path_factory.mktemp("docs")
    rows = [f"{step / 10:.1f},{agent},{math.cos(agent) * 5 + step * 0.05:.3f},{math.sin(agent) * 5:.3f},0.5"
            for step in range(151) for agent in range(1, 21)]
    (folder / "run.csv").write_text("time_s,id,x_m,y_m,speed\n" + "\n".join(rows) + "\n")
    (folder / "walk.txt").write_text("".join(f"{agent} {frame} {agent * 100 + frame * 8} {agent * 50} 170\n"
                                             for agent in range(1, 6) for frame in range(8)))
    (folder / "area.wkt").write_text("POLYGON ((-8 -8, 16 -8, 16 8, -8 8, -8 -8), (0 -1, 2 -1, 2 1, 0 1, 0 -1))")
    subprocess.run([BUILD / "bin/throng", "convert", "run.csv", "run.sqlite"], cwd=folder, check=True, capture_output=True)
    made = json.loads((BUILD / "cast/cast.json").read_text())
    made["characters"] = [one for one in made["characters"] if one["name"] == "commuter"]
    (folder / "cast").mkdir()
    (folder / "cast/cast.json").write_text(json.dumps(made))
    shutil.copy(BUILD / "cast" / made["characters"][0]["file"], folder / "cast")
    shutil.copy(BUILD / "cast" / made["characters"][0]["file"], folder / "cast/knight.throng")
    return folder


def environment(url=None):
    path = f"{BUILD / 'bin'}:{os.environ['PATH']}"
    return {**os.environ, "PATH": path, **({"THRONG_URL": url} if url else {})}


def run(place, command, more="", url=None, timeout=300):
    done = subprocess.run(shlex.split(f"{command} {more}"), cwd=place, env=environment(url), capture_output=True, text=True,
                          timeout=timeout)
    assert done.returncode == 0, (command, done.stderr)
    return done


def start_server(place, command):
    """A server of a command's options but on a free port. Gives process, first lines, address."""
    words = re.sub(r"(--listen|--http) 127\.0\.0\.1:\d+", r"\1 127.0.0.1:0", command)
    if "--listen" not in words:
        words += " --listen 127.0.0.1:0"
    process = subprocess.Popen(shlex.split(words + " --log-level off"), cwd=place, env=environment(), stdout=subprocess.PIPE,
                               text=True)
    lines = []
    for line in process.stdout:
        lines.append(line)
        if ready := re.match(r"throng-server ready on (\S+),", line):
            return process, lines, ready[1]
    raise AssertionError(f"{words} did not start: {lines}")


def stop(process):
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=60) == 0


@pytest.fixture(scope="module")
def station(place):
    """A server that a file was published to, as README does it."""
    process, _, url = start_server(place, "throng-server --listen 127.0.0.1:7447")
    publisher = subprocess.Popen(
        shlex.split("throng publish run.sqlite --crowd station --loop --rate 20"), cwd=place, env=environment(url),
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while True:  # until the file's 15 seconds are there
        crowds = json.loads(run(place, "throng crowds --json", url=url).stdout)["crowds"]
        if crowds and int(crowds[0]["newest_time_us"]) > 13e6:
            break
        assert publisher.poll() is None
    yield url
    publisher.send_signal(signal.SIGTERM)
    publisher.wait(timeout=60)
    stop(process)


# --- what each command must do: a function of (place, command, request)

def renders(*files, more=SMALL):
    def check(place, command, request):
        run(place, command, more)
        for file in files:
            assert (place / file).stat().st_size > 1000, file
    return check


def views(check, more="", replace=("", "")):
    def run_it(place, command, request):
        done = run(place, command.replace(*replace), more, url=request.getfixturevalue("station"))
        assert check(done, place), (command, done.stdout, done.stderr)
    return run_it


def window(file):
    def check(place, command, request):
        if not (BUILD / "bin/throng-view").exists():
            pytest.skip("throng-view was not built (libsdl2-dev, libimgui-dev)")
        run(place, command, "--size 320x240", url=request.getfixturevalue("station"))
        assert (place / file).read_bytes()[:4] == b"\x89PNG"
    return check


def serves(line):
    def check(place, command, request):
        process, lines, _ = start_server(place, command)
        stop(process)
        assert any(line in one for one in lines), lines
    return check


def prints(*words):
    def check(place, command, request):
        text = run(place, command).stdout
        for word in words:
            assert word in text, text
    return check


def elsewhere(path):
    def check(place, command, request):
        assert (ROOT / path).exists()
    return check


def bakes(place, command, request):
    data = request.getfixturevalue("data_dir") / "characters"
    for name, source in (("knight.glb", "kaykit_knight.glb"), ("mage.glb", "kaykit_mage.glb")):
        shutil.copy(data / source, place / name)
    run(place, command.replace("-o cast", "-o baked"))
    made = json.loads((place / "baked/cast.json").read_text())
    assert [one["name"] for one in made["characters"]] == ["knight", "mage"]


def builtin_cast(place, command, request):
    made = json.loads((BUILD / "cast/cast.json").read_text())  # the build makes it by this very command
    assert len(made["characters"]) >= 10 and all(one["source"] == "builtin" for one in made["characters"])


def records_a_run(place, command, request):
    process, _, url = start_server(place, command)
    run(place, "throng publish run.sqlite --crowd station --rate 50", url=url)
    stop(process)
    [part] = (place / "runs").glob("station.*.trec")
    info = json.loads(run(place, f"throng info --json {part}").stdout)
    assert (info["format"], info["frames"], info["agents"]) == ("throng-recording", 151, 20)
    renamed = place / "runs/station.20260131T120000Z.0001.trec"  # the name in README
    part.rename(renamed)


def plays_a_recording(place, command, request):
    process, _, url = start_server(place, "throng-server")
    done = run(place, command, "--rate 50", url=url)
    stop(process)
    assert "151 applied" in done.stderr


def environment_of_a_file(place, command, request):
    run(place, f"{command} run.csv -o walled.png --frames 1", SMALL)
    run(place, "throng-render run.csv -o bare.png --frames 1", SMALL)
    assert (place / "walled.png").read_bytes() != (place / "bare.png").read_bytes()


def removes(place, command, request):
    process, _, url = start_server(place, "throng-server")
    run(place, "throng publish run.sqlite --crowd station --rate 200", url=url)
    run(place, command, url=url)
    assert json.loads(run(place, "throng crowds --json", url=url).stdout)["crowds"] == []
    stop(process)


EXPECTED = {
    "./deploy/demo": elsewhere("tests/integration/test_demo.py"),
    "./deploy/test": elsewhere("deploy/test"),  # runs this
    "throng-server --listen 127.0.0.1:7447 --http 127.0.0.1:7480": serves("page at http://127.0.0.1:"),
    "throng-server --http 127.0.0.1:7480": serves("page at http://127.0.0.1:"),
    "throng-server --record runs": records_a_run,
    "throng publish runs/station.20260131T120000Z.0001.trec --crowd again": plays_a_recording,
    "throng publish run.sqlite --crowd station --loop": views(lambda done, place: "station" in done.stdout,
                                                              replace=("throng publish run.sqlite --crowd station --loop",
                                                                       "throng crowds")),
    ".venv/bin/python client/python/examples/jupedsim_bottleneck.py": elsewhere("tests/client/python/test_jupedsim.py"),
    ".venv/bin/python client/python/examples/sumo_town.py": elsewhere("tests/integration/test_examples.py"),
    "./deploy/setup --sumo": elsewhere("deploy/test"),
    "throng crowds": views(lambda done, place: "station" in done.stdout),
    "throng record --crowd station -o station.mp4 --seconds 20": views(
        lambda done, place: b"ftyp" in (place / "station.mp4").read_bytes()[:64], "--size 320x180",
        ("--seconds 20", "--seconds 1")),
    "throng record --crowd station -o 'frames/####.jpg' --camera 10,-8,6:10,5,1": views(
        lambda done, place: len(list((place / "frames").glob("*.jpg"))) == 5, "--frames 5 --size 320x180"),
    "throng snapshot --crowd station --time 12.5 -o then.png": views(
        lambda done, place: (place / "then.png").read_bytes()[:4] == b"\x89PNG", "--size 320x180"),
    "throng snapshot --crowd station -o plan.png --camera top": views(
        lambda done, place: (place / "plan.png").read_bytes()[:4] == b"\x89PNG", "--size 320x180"),
    "throng remove station": removes,
    "throng remove": elsewhere("tests/client/cli/cli_test.cpp"),
    "throng doctor": prints("raster", "server: "),
    "throng-render run.sqlite -o 'out/####.png'": renders("out/0001.png", "out/0101.png"),
    "throng-render walk.txt --source-fps 16 --source-unit cm -o walk.mp4 --size 1920x1080": renders(
        "walk.mp4", more="--vertex-budget 20000"),
    "throng-render run.sqlite -o 'out/####.png' --shard 2/3": renders("out/0002.png"),
    "throng-render run.sqlite -o '{camera}.mp4' --camera overview --camera top --camera follow:17": renders(
        "overview.mp4", "top.mp4", "follow-17.mp4"),
    "throng-render run.csv -o run.mp4 --channel speed --channel-range 0:2 --overlay time,legend --title 'Exit B'": renders(
        "run.mp4"),
    "throng-render --synthetic 30000 --seed 7 -o 'crowd/####.png' --frames 1-25": renders("crowd/0001.png", "crowd/0025.png"),
    "throng-render run.sqlite -o '{pass}/####.png' --passes color,depth,id --boxes gt.txt": renders(
        "color/0001.png", "depth/0001.exr", "id/0001.exr", "gt.txt", more=f"{SMALL} --frames 1-5"),
    "throng-render --environment area.wkt": environment_of_a_file,
    "throng-bake --builtin -o cast": builtin_cast,
    "throng-bake knight.glb mage.glb -o cast --height 1.75": bakes,
    "throng-bake inspect cast": prints("commuter"),
    "throng-bake sheet cast -o sheet.png": renders("sheet.png", more=""),
    "throng-bake report cast -o report": elsewhere("tests/simplify/report"),
    "throng-bake export cast/knight.throng --vertices 500 -o lod.obj": renders("lod.obj", more=""),
    "throng convert": elsewhere("tests/client/trajectory/convert_test.cpp"),
    "throng convert run.sqlite fcd.xml.gz": prints("fcd.xml.gz"),
    "throng-bake report": elsewhere("tests/simplify/report"),
    "throng-bench raster": elsewhere("tests/bench/experiments/experiments_test.cpp"),
    "throng-bench paper": elsewhere("tests/bench/experiments/experiments_test.cpp"),
    "throng-bench all --json-dir tests/bench/results": elsewhere("tests/bench/experiments/experiments_test.cpp"),
    "throng-view --server host:7447 --crowd station": elsewhere("tests/client/desktop/test_window.py"),
    "throng-view --crowd station --overlays time,scale --screenshot station.png": window("station.png"),
    "throng-view --view 'crowd=station&cam=0,0,0,20,-90,30&t=3&show=grid' --screenshot then.png": window("then.png"),
    "cmake --build build/release --target throng_manual": elsewhere("tests/integration/test_manual.py"),
    "source deploy/completion/throng.bash": elsewhere("tests/integration/test_manual.py"),
    "export PATH=$PWD/build/release/bin:$PATH": elsewhere("deploy/demo"),
}


def knows_its_options(place, command, request):
    """What can be said of any command: its program is there and knows the options that are shown."""
    words = shlex.split(command)
    if not (BUILD / "bin" / words[0]).exists():
        pytest.skip(f"{words[0]} was not built")
    subcommand = words[1:2] if re.fullmatch(r"[a-z]+", (words + [""])[1]) else []
    shown = subprocess.run([BUILD / "bin" / words[0], *subcommand, "--help"], capture_output=True, text=True).stdout
    assert [word for word in words if word.startswith("--") and word.split("=")[0] not in shown] == []


@pytest.mark.parametrize("command", commands())
def test_command(command, place, request):
    EXPECTED.get(command, knows_its_options)(place, command, request)


def test_every_command_of_a_block_is_run_by_a_test():
    """What is only named within a sentence may be known by its options alone."""
    shown = [line for block in blocks("sh") for line in block.replace("\\\n", " ").splitlines()]
    words = [shlex.split(re.sub(r"(^|\s)#\s.*", "", line)) for line in shown]
    assert [shlex.join(one) for one in words if one and shlex.join(w for w in one if w != "&") not in EXPECTED] == []


def test_python_of_readme_publishes(place, station):
    [program] = [block for block in blocks("python") if "throng.connect" in block]
    program = program.replace("127.0.0.1:7447", station).replace('"station"', '"python"').replace("range(600)", "range(12)")
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)
    crowds = json.loads(run(place, "throng crowds --json", url=station).stdout)["crowds"]
    assert next(crowd for crowd in crowds if crowd["name"] == "python")["agents"] == 200
