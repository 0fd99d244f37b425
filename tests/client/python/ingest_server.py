"""A small ingest server inside the test process: it keeps what it is told and misbehaves on demand."""

from __future__ import annotations

import threading
from concurrent import futures
from typing import Callable, Dict, List, Optional

import grpc
import numpy as np

from throng.v1 import ingest_pb2, ingest_pb2_grpc

Ack = ingest_pb2.FrameAck


class Assembled:
    """One complete frame as the server put it together."""

    def __init__(self, chunk: ingest_pb2.AgentChunk, membership: ingest_pb2.Membership, stream: int):
        self.index = chunk.frame_index
        self.time_us = chunk.scene_time_us
        self.epoch = chunk.epoch
        self.stream = stream
        self.ids = np.frombuffer(membership.ids, "<u8")
        self.names = list(membership.names)
        self.chunks = 0
        self.positions = np.zeros((0, 3), np.float32)
        self.headings: Optional[np.ndarray] = None
        self.quaternions: Optional[np.ndarray] = None
        self.channels: List[np.ndarray] = []
        self.motions: List[str] = []

    def add(self, chunk: ingest_pb2.AgentChunk) -> bool:
        """Returns True when the frame is complete."""
        assert chunk.first_agent == len(self.positions), "chunks of a frame follow one another"
        rows = np.frombuffer(chunk.positions, "<f4").reshape(-1, 3)
        self.positions = np.concatenate([self.positions, rows])
        kind = chunk.WhichOneof("orientation")
        if kind == "headings":
            self.headings = _join(self.headings, np.frombuffer(chunk.headings, "<f4"), len(rows))
        elif kind == "quaternions":
            self.quaternions = _join(self.quaternions, np.frombuffer(chunk.quaternions, "<f4").reshape(-1, 4), len(rows))
        columns = [np.frombuffer(column, "<f4") for column in chunk.channels]
        assert all(len(column) == len(rows) for column in columns)
        self.channels = ([np.concatenate(pair) for pair in zip(self.channels, columns)] if self.chunks else columns)
        assert len(chunk.motions) in (0, len(rows)) and (chunk.motions or not chunk.motion_names)
        self.motions += [chunk.motion_names[code - 1] if code else "" for code in chunk.motions]
        self.chunks += 1
        return len(self.positions) == len(self.ids)


def _join(before: Optional[np.ndarray], rows: np.ndarray, count: int) -> np.ndarray:
    assert len(rows) == count
    return rows if before is None else np.concatenate([before, rows])


class IngestServer(ingest_pb2_grpc.IngestServiceServicer):
    def __init__(self, port: int = 0, max_chunk_bytes: int = 4 << 20, max_agents: int = 1_000_000,
                 keep_frames: bool = True):
        self.max_chunk_bytes = max_chunk_bytes
        self.max_agents = max_agents
        self.keep_frames = keep_frames
        self.changed = threading.Condition()
        self.starts: List[ingest_pb2.StartPublishing] = []
        self.metadata: List[Dict[str, str]] = []
        self.memberships: List[ingest_pb2.Membership] = []
        self.environments: List[str] = []
        self.frames: List[Assembled] = []
        self.largest_message_bytes = 0
        self.bytes_read = 0
        self.half_closes = 0
        self.forget_membership_once = False          # acks the next frame as of an unknown epoch
        self.refuse: Optional[grpc.StatusCode] = None
        self.max_environment_bytes = 4 << 20
        self.break_after: Optional[int] = None       # frames after which a stream is aborted, once
        self.reading = threading.Event()             # cleared: the server stops reading after start
        self.reading.set()
        self._server = grpc.server(futures.ThreadPoolExecutor(8), options=[
            ("grpc.max_receive_message_length", max_chunk_bytes), ("grpc.so_reuseport", 0)])
        ingest_pb2_grpc.add_IngestServiceServicer_to_server(self, self._server)
        self.port = self._server.add_insecure_port(f"127.0.0.1:{port}")
        assert self.port, "the port is taken"
        self._server.start()

    @property
    def url(self) -> str:
        return f"127.0.0.1:{self.port}"

    def stop(self) -> None:
        self.reading.set()
        self._server.stop(None).wait()

    def wait(self, condition: Callable[["IngestServer"], bool], timeout_s: float = 20.0) -> None:
        """Waits until something the server has seen makes `condition` true."""
        with self.changed:
            assert self.changed.wait_for(lambda: condition(self), timeout_s), "the server never saw it"

    def PublishAgents(self, request_iterator, context):
        membership: Optional[ingest_pb2.Membership] = None
        frame: Optional[Assembled] = None
        done = 0
        stream = len(self.starts)
        with self.changed:
            self.metadata.append({key: value for key, value in context.invocation_metadata()})
            self.changed.notify_all()
        if self.refuse is not None:
            context.abort(self.refuse, "refused by the test")
        for request in request_iterator:
            self.reading.wait()
            size = request.ByteSize()
            kind = request.WhichOneof("message")
            with self.changed:
                self.largest_message_bytes = max(self.largest_message_bytes, size)
                self.bytes_read += size
                if kind == "start":
                    self.starts.append(request.start)
                elif kind == "membership":
                    assert membership is None or request.membership.epoch > membership.epoch
                    membership = request.membership
                    self.memberships.append(membership)
                elif kind == "environment":
                    self.environments.append(request.environment.walkable_area_wkt)
                self.changed.notify_all()
            if kind == "environment" and size > self.max_environment_bytes:
                context.abort(grpc.StatusCode.RESOURCE_EXHAUSTED, f"environment.walkable_area_wkt: {size} bytes")
            if kind == "start":
                yield ingest_pb2.PublishAgentsResponse(start=ingest_pb2.StartAck(
                    server_run_id="test", max_chunk_bytes=self.max_chunk_bytes, max_agents=self.max_agents))
            elif kind == "membership":
                yield ingest_pb2.PublishAgentsResponse(membership=ingest_pb2.MembershipAck(epoch=membership.epoch))
            elif kind == "chunk":
                chunk = request.chunk
                if self.forget_membership_once:
                    self.forget_membership_once = False
                    membership = None
                if membership is None or chunk.epoch != membership.epoch:
                    yield _frame_ack(chunk.frame_index, Ack.OUTCOME_UNKNOWN_EPOCH)
                    continue
                if frame is None or frame.index != chunk.frame_index:
                    frame = Assembled(chunk, membership, stream)
                if not frame.add(chunk):
                    continue
                done += 1
                with self.changed:
                    self.frames.append(frame)
                    if not self.keep_frames:
                        del self.frames[:-1]
                    self.changed.notify_all()
                if self.break_after is not None and done >= self.break_after:
                    self.break_after = None
                    context.abort(grpc.StatusCode.UNAVAILABLE, "broken by the test")
                yield _frame_ack(chunk.frame_index, Ack.OUTCOME_APPLIED)
        with self.changed:
            self.half_closes += 1
            self.changed.notify_all()


def _frame_ack(index: int, outcome: int) -> ingest_pb2.PublishAgentsResponse:
    return ingest_pb2.PublishAgentsResponse(frame=Ack(frame_index=index, outcome=outcome, viewers=3))
