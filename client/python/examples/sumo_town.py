"""The people of a SUMO town, published live. SUMO makes the town itself: a grid of streets.

    pip install eclipse-sumo traci libsumo sumolib
    throng-server --http 127.0.0.1:7480        # then open http://127.0.0.1:7480/
    python sumo_town.py --seconds 120
"""

import argparse
import pathlib
import subprocess
import tempfile
import time

import libsumo as traci  # or: import traci
import sumo

import throng
from throng.sumo import PersonPublisher

BIN = pathlib.Path(sumo.SUMO_HOME) / "bin"
STEP_S = 0.5
ROUTES = """<routes>
  <personFlow id="east" begin="0" end="3600" period="1"><walk from="A0B0" to="C2C1"/></personFlow>
  <personFlow id="west" begin="0" end="3600" period="1"><walk from="C2B2" to="A1A0"/></personFlow>
</routes>"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--url", help="HOST:PORT of throng-server (default: $THRONG_URL or 127.0.0.1:7447)")
    parser.add_argument("--seconds", type=float, default=120.0, help="how long to run (default: 120)")
    parser.add_argument("--fast", action="store_true", help="do not wait for real time")
    arguments = parser.parse_args()

    with tempfile.TemporaryDirectory() as folder:
        net, routes = pathlib.Path(folder, "town.net.xml"), pathlib.Path(folder, "walk.rou.xml")
        subprocess.run([BIN / "netgenerate", "--grid", "--grid.number", "3", "--grid.length", "40",
                        "--sidewalks.guess", "true", "--crossings.guess", "true", "-o", net],
                       check=True, stdout=subprocess.DEVNULL)
        routes.write_text(ROUTES)
        traci.start([str(BIN / "sumo"), "-n", str(net), "-r", str(routes), "--step-length", str(STEP_S),
                     "--no-step-log"])
        with throng.connect(arguments.url, "town", rate_hz=1 / STEP_S) as pub:
            persons = PersonPublisher(pub, traci)
            while traci.simulation.getTime() < arguments.seconds:
                traci.simulationStep()
                persons.publish()
                if not arguments.fast:
                    time.sleep(STEP_S)
        traci.close()
    print(f"{pub.stats.published} frames published, {pub.stats.applied} applied, {pub.stats.dropped} dropped")
    return 0 if pub.stats.applied else 1


if __name__ == "__main__":
    raise SystemExit(main())
