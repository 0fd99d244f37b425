"""Publish a running crowd simulation to a throng server, and look at finished ones.

    import throng

    with throng.connect(crowd="station") as pub:
        for step in range(1000):
            ...                                    # one step of the simulator
            pub.publish(t, ids, positions)         # seconds, [A], [A, 2] or [A, 3] metres

Publishing never stalls the simulation and never raises into it: frames wait in a bounded queue that
drops the oldest, a thread of its own sends them and connects again by itself, and a frame that makes
no sense is logged once, counted in `pub.stats` and left out.

    pictures = throng.render("run.sqlite", size=(640, 360))    # uint8 [F, 360, 640, 3]
    throng.show("run.sqlite")                                   # a video, in a notebook
"""

from throng._ids import hash_id
from throng._publisher import MOTIONS, Publisher, Stats, connect
from throng._viewing import Page, RenderError, Video, frames, render, show

__version__ = "0.1.0"
__all__ = ["MOTIONS", "Page", "Publisher", "RenderError", "Stats", "Video", "connect", "frames", "hash_id", "render",
           "show"]
