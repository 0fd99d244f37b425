"""Frames per second that the Python producer publishes, over real gRPC on loopback.

    python tests/bench/publish_bench.py --agents 100000 --frames 300 [--url HOST:PORT] [--one-core]

Without --url it publishes to a sink: a small Python server in a process of its own that reads
everything, parses it and acknowledges each frame. Prints one line of JSON: `call_us` is what one
`publish` costs the simulation, `applied_per_s` what arrives when publishing as fast as it goes.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import statistics
import sys
import time
from concurrent import futures

import numpy as np


def sink(port_sender) -> None:
    import grpc

    from throng.v1 import ingest_pb2, ingest_pb2_grpc

    class Sink(ingest_pb2_grpc.IngestServiceServicer):
        def PublishAgents(self, requests, context):
            members = rows = 0
            for request in requests:
                kind = request.WhichOneof("message")
                if kind == "start":
                    yield ingest_pb2.PublishAgentsResponse(start=ingest_pb2.StartAck(
                        max_chunk_bytes=16 << 20, max_agents=1 << 22))
                elif kind == "membership":
                    members = len(request.membership.ids) // 8
                elif kind == "chunk":
                    rows += len(request.chunk.positions) // 12
                    if rows == members:
                        rows = 0
                        yield ingest_pb2.PublishAgentsResponse(frame=ingest_pb2.FrameAck(
                            frame_index=request.chunk.frame_index, outcome=ingest_pb2.FrameAck.OUTCOME_APPLIED))

    server = grpc.server(futures.ThreadPoolExecutor(2), options=[("grpc.max_receive_message_length", 16 << 20)])
    ingest_pb2_grpc.add_IngestServiceServicer_to_server(Sink(), server)
    port_sender.send(server.add_insecure_port("127.0.0.1:0"))
    server.start()
    server.wait_for_termination()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--agents", type=int, default=100_000)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--url", help="a server to publish to instead of the sink")
    parser.add_argument("--one-core", action="store_true", help="keep the producer's process on one core")
    arguments = parser.parse_args()

    process = None
    url = arguments.url
    if url is None:
        receiver, sender = multiprocessing.Pipe(False)
        process = multiprocessing.get_context("spawn").Process(target=sink, args=(sender,), daemon=True)
        process.start()
        url = f"127.0.0.1:{receiver.recv()}"
    if arguments.one_core:
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

    import throng

    rng = np.random.default_rng(1)
    ids = np.arange(arguments.agents)
    positions = rng.uniform(-300, 300, (arguments.agents, 2))
    headings = rng.uniform(-3, 3, arguments.agents)
    calls_s = []
    pub = throng.connect(url, "bench", rate_hz=30)
    pub.publish(0.0, ids, positions, headings)
    while pub.stats.applied == 0:
        time.sleep(0.001)
    cpu_begin_s, begin_s = time.process_time(), time.perf_counter()
    for frame in range(1, arguments.frames + 1):
        while pub.stats.queued >= 8:  # as fast as frames are taken, without dropping any
            time.sleep(0.0002)
        call_s = time.perf_counter()
        pub.publish(frame / 30, ids, positions, headings)
        calls_s.append(time.perf_counter() - call_s)
    clean = pub.close(60)
    wall_s, cpu_s = time.perf_counter() - begin_s, time.process_time() - cpu_begin_s
    stats = pub.stats
    print(json.dumps({
        "agents": arguments.agents, "frames": arguments.frames, "clean": clean, "dropped": stats.dropped,
        "applied_per_s": round((stats.applied - 1) / wall_s, 1),
        "mb_per_s": round(arguments.frames * arguments.agents * 16 / wall_s / 1e6, 1),
        "call_us_median": round(statistics.median(calls_s) * 1e6), "call_us_max": round(max(calls_s) * 1e6),
        "producer_cpu_ms_per_frame": round(cpu_s / arguments.frames * 1e3, 2)}))
    if process is not None:
        process.kill()
        process.join()
    return 0 if clean else 1


if __name__ == "__main__":
    sys.exit(main())
