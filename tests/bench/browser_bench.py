"""Frame rate and latency in a real browser: 1,000 agents at 1280x720 on loopback, all on this machine.

Latency is glass to glass: from the camera's change in the page (performance.now when the option is sent) to
the picture that was drawn with it being on the canvas. The goal is 25 frames a second and under 100 ms at
the median on two cores. Usage: .venv/bin/python tests/bench/browser_bench.py [--agents N] [--seconds N] [--json]
"""

import argparse
import json
import os
import pathlib
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/client/browser"))

import devtools  # noqa: E402
from conftest import Producer, Server, walkers  # noqa: E402

# Turns the camera a little for each frame that was shown, as a hand would.
TURN = """(() => {
    const canvas = document.getElementById('picture');
    const at = (type, x) => canvas.dispatchEvent(new PointerEvent(type,
        {pointerId: 1, clientX: x, clientY: 360, button: 0, buttons: 1, bubbles: true, isPrimary: true}));
    canvas.setPointerCapture = () => {};
    let x = 400, step = 3;
    at('pointerdown', x);
    window.turning = setInterval(() => {
        if (x > 900 || x < 300) step = -step;
        at('pointermove', x += step);
    }, 33); })()"""


def cpu_seconds(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if devtools.find_chromium() is None:
        sys.exit("browser_bench: no chromium (Debian package chromium)")
    with tempfile.TemporaryDirectory() as folder:
        walk = walkers(pathlib.Path(folder) / "walk.csv", options.agents, 20.0, 5.0, ring_m=0.02)
        server = Server(budget=None)
        producer = Producer(server, walk, "bench")
        browser = devtools.Browser()
        try:
            page = browser.page(1280, 720)
            page.open(server.page + "#crowd=bench&cam=0,0,0,45,-90,35")
            page.wait("document.body.dataset.frame")
            page.press("x")
            page.evaluate(TURN)
            time.sleep(4)  # the budget controller settles
            before, began = page.evaluate("window.throngView.shown"), time.monotonic()
            cpu = cpu_seconds(server.process.pid)
            page.evaluate("window.throngView.latencies.length = 0")
            latencies = []
            while time.monotonic() - began < options.seconds:
                time.sleep(0.5)
                latencies += page.evaluate("window.throngView.latencies.splice(0)")
            elapsed = time.monotonic() - began
            frames = page.evaluate("window.throngView.shown") - before
            cpu = cpu_seconds(server.process.pid) - cpu
            stats = page.evaluate("window.throngView.header.stats")
            page.evaluate("clearInterval(window.turning)")
        finally:
            browser.close()
            producer.stop()
            server.stop()
    latencies.sort()
    result = {
        "agents": options.agents, "frames_per_second": round(frames / elapsed, 1),
        "latency_median_ms": round(latencies[len(latencies) // 2], 1),
        "latency_p95_ms": round(latencies[int(len(latencies) * 0.95)], 1),
        "server_cpu_ms_per_frame": round(1000 * cpu / max(1, frames), 1),
        "vertices": int(stats.get("vertices", 0)), "load_average": round(os.getloadavg()[0], 1),
        "cores": os.cpu_count(),
    }
    if options.json:
        print(json.dumps(result))
    else:
        for name, value in result.items():
            print(f"{name:26} {value}")


if __name__ == "__main__":
    main()
