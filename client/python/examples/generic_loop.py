"""Any simulator's loop, published live: two hundred walkers who turn back at the walls.

    throng-server --http 127.0.0.1:7480        # then open http://127.0.0.1:7480/
    python generic_loop.py --seconds 60
"""

import argparse
import time

import numpy as np

import throng

STEP_S = 0.1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--url", help="HOST:PORT of throng-server (default: $THRONG_URL or 127.0.0.1:7447)")
    parser.add_argument("--seconds", type=float, default=60.0, help="how long to run (default: 60)")
    parser.add_argument("--fast", action="store_true", help="do not wait for real time")
    arguments = parser.parse_args()

    rng = np.random.default_rng(1)
    ids = np.arange(200)
    xy = rng.uniform(0, 20, (200, 2))
    angle = rng.uniform(-np.pi, np.pi, 200)
    speed = rng.normal(1.34, 0.2, 200).clip(0.7, 2.0)
    with throng.connect(arguments.url, "loop", channels={"speed": "m/s"}, rate_hz=1 / STEP_S) as pub:
        pub.scene(wkt="POLYGON ((0 0, 20 0, 20 20, 0 20, 0 0))")
        for step in range(int(arguments.seconds / STEP_S)):
            angle += rng.normal(0, 0.1, 200)
            way = np.stack([np.cos(angle), np.sin(angle)], axis=1) * speed[:, None] * STEP_S
            out = ((xy + way < 0) | (xy + way > 20)).any(axis=1)
            angle[out] += np.pi
            xy[~out] += way[~out]
            pub.publish(step * STEP_S, ids, xy, speed=np.where(out, 0, speed))
            if not arguments.fast:
                time.sleep(STEP_S)
    print(f"{pub.stats.published} frames published, {pub.stats.applied} applied, {pub.stats.dropped} dropped")
    return 0 if pub.stats.applied else 1


if __name__ == "__main__":
    raise SystemExit(main())
