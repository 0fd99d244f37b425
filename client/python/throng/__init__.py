"""Publish a running crowd simulation to a throng server.

    import throng

    with throng.connect(crowd="station") as pub:
        for step in range(1000):
            ...                                    # one step of the simulator
            pub.publish(t, ids, positions)         # seconds, [A], [A, 2] or [A, 3] metres

Publishing never stalls the simulation and never raises into it: frames wait in a bounded queue that
drops the oldest, a thread of its own sends them and connects again by itself, and a frame that makes
no sense is logged once, counted in `pub.stats` and left out.
"""

from throng._ids import hash_id
from throng._publisher import Publisher, Stats, connect

__version__ = "0.1.0"
__all__ = ["Publisher", "Stats", "connect", "hash_id"]
