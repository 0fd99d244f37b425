"""One connection at a time to the ingest service: bounded queue in, chunks out, back-off between."""

from __future__ import annotations

import random
import socket
import threading
import time
from collections import deque
from typing import Callable, Deque, Dict, Iterator, NamedTuple, Optional

import grpc
import numpy as np

from throng._frame import Frame
from throng._ids import Membership
from throng.v1 import common_pb2, ingest_pb2, ingest_pb2_grpc

Report = Callable[[str, str], None]

ACK_TIMEOUT_S = 10.0           # a server silent for so long is as good as gone
FIRST_BACK_OFF_S = 0.1
LAST_BACK_OFF_S = 5.0
_DEFAULT_CHUNK_BYTES = 4 << 20  # gRPC's own limit, where a server does not say
_CHUNK_OVERHEAD_BYTES = 512     # field headers, frame index, time, epoch
_MIN_CHUNK_BYTES = 4096

# What this producer did not cause and can't cure: said once, tried again slowly.
_REFUSED_NAMES = frozenset(("ALREADY_EXISTS", "UNAUTHENTICATED", "PERMISSION_DENIED", "INVALID_ARGUMENT",
                            "UNIMPLEMENTED", "RESOURCE_EXHAUSTED", "FAILED_PRECONDITION"))
# The connection was lost rather than refused: the crowd is still this producer's.
_BROKEN_NAMES = frozenset(("UNAVAILABLE", "CANCELLED", "UNKNOWN", "INTERNAL"))


class Endpoint(NamedTuple):
    """Where the server is and how to get in."""

    target: str
    tls: bool
    token: Optional[str]
    ca_file: Optional[str]

    @classmethod
    def parse(cls, url: str, token: Optional[str], ca_file: Optional[str]) -> "Endpoint":
        scheme, separator, rest = url.partition("://")
        if not separator:
            scheme, rest = "grpc", url
        if scheme not in ("grpc", "http", "grpcs", "https"):
            raise ValueError(f"connect: url is {url!r}, must be HOST:PORT, grpc://HOST:PORT or grpcs://HOST:PORT")
        target = rest.rstrip("/")
        host, colon, port = target.rpartition(":")
        if not colon or host.endswith(":") or (":" in host and not host.startswith("[")):
            host, port = target, "7447"
        if not host or "/" in host or not port.isdigit() or not 0 < int(port) < 65536:
            raise ValueError(f"connect: url is {url!r}, must be HOST:PORT with a port from 1 to 65535")
        return cls(f"{host}:{port}", scheme in ("grpcs", "https"), token, ca_file)

    def channel(self) -> grpc.Channel:
        # A pool of its own, so that a new channel connects at once instead of waiting out gRPC's back-off.
        options = [("grpc.max_send_message_length", -1), ("grpc.use_local_subchannel_pool", 1),
                   ("grpc.initial_reconnect_backoff_ms", 100), ("grpc.enable_http_proxy", 0)]
        if not self.tls:
            return grpc.insecure_channel(self.target, options)
        roots = None
        if self.ca_file:
            with open(self.ca_file, "rb") as file:
                roots = file.read()
        return grpc.secure_channel(self.target, grpc.ssl_channel_credentials(roots), options)

    @property
    def metadata(self) -> Optional[list]:
        return [("authorization", f"Bearer {self.token}")] if self.token else None


class _Session:
    """One stream. The request iterator runs on a gRPC thread, answers are read by the sender's."""

    def __init__(self, run: int) -> None:
        self.run = run
        self.call: Optional[grpc.Call] = None
        self.accepted = False                  # StartAck has come
        self.ended = False
        self.completed = False                 # the request side has sent all it had to
        self.environment_version = -1
        self.membership: Optional[Membership] = None
        self.resend_membership = False
        self.first_frame_of_epoch = 0          # acks of older frames speak of an older epoch
        self.newest_frame: Optional[Frame] = None
        self.sent_frames = 0
        self.acked_frames = 0
        self.waiting_since: Optional[float] = None  # oldest thing that has not been acknowledged
        self.chunk_bytes = _DEFAULT_CHUNK_BYTES
        self.max_agents = 0


class Sender:
    """Owns the queue, the thread and the connection of a publisher. All public calls return at once,
    except `close`."""

    def __init__(self, endpoint: Endpoint, crowd: str, run_id: str, origin_m: np.ndarray, seed: int,
                 producer: str, take_over: bool, report: Report):
        self._endpoint = endpoint
        self._crowd = crowd
        self._run_id = run_id
        self._origin_m = origin_m
        self._seed = seed
        self._producer = producer
        self._take_over = take_over
        self._report = report
        self._channels: Dict[str, str] = {}
        self._rate_hz = 0.0

        self._changed = threading.Condition()
        self._queue: Deque[Frame] = deque()
        self._queued_bytes = 0
        self._environment: Optional[str] = None
        self._environment_version = 0
        self._session: Optional[_Session] = None
        self._closing = False
        self._abandon = False
        self._thread: Optional[threading.Thread] = None
        self._epoch = 0
        self._frame_index = 0
        self._reclaim = False   # the last stream broke while it was ours
        self._run = 0
        self._counts = {"sent": 0, "applied": 0, "late": 0, "incomplete": 0, "unknown_epoch": 0,
                        "memberships": 0, "connections": 0, "viewers": 0}
        self.finished_clean = True

    def start(self, channels: Dict[str, str], rate_hz: float) -> None:
        """Begins to connect. Channels and rate are part of the first message."""
        if self._thread is not None:
            return
        self._channels, self._rate_hz = dict(channels), rate_hz
        self._thread = threading.Thread(target=self._work, name="throng-publisher", daemon=True)
        self._thread.start()

    def put(self, frame: Frame, max_frames: int, max_bytes: int) -> int:
        """Queues a frame and returns how many older ones had to go."""
        dropped = 0
        with self._changed:
            self._queue.append(frame)
            self._queued_bytes += frame.size_bytes
            # The newest frame stays even if it alone is over the limit.
            while len(self._queue) > 1 and (len(self._queue) > max_frames or self._queued_bytes > max_bytes):
                self._queued_bytes -= self._queue.popleft().size_bytes
                dropped += 1
            self._changed.notify_all()
        return dropped

    def set_environment(self, wkt: str) -> None:
        with self._changed:
            if wkt != self._environment:
                self._environment = wkt
                self._environment_version += 1
                self._changed.notify_all()

    def watch(self) -> None:
        """Gives up a connection whose server has long been silent. Called by every `publish`."""
        session = self._session
        if session is None or session.waiting_since is None or session.call is None:
            return
        if time.monotonic() - session.waiting_since > ACK_TIMEOUT_S:
            session.waiting_since = None
            self._report("silent", f"publish: {self._endpoint.target} has not answered for {ACK_TIMEOUT_S:.0f} s, "
                                   "connecting again")
            session.call.cancel()

    def counts(self) -> Dict[str, int]:
        with self._changed:
            session = self._session
            return dict(self._counts, queued=len(self._queue),
                        connected=bool(session and session.accepted and not session.ended))

    def close(self, timeout_s: float) -> int:
        """Returns how many frames were left unsent. See Publisher.close."""
        if self._thread is None:
            return 0
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join(timeout_s)
        with self._changed:
            self._abandon = True
            left = len(self._queue)
            self._queue.clear()
            self._queued_bytes = 0
            session = self._session
            self._changed.notify_all()
        if self._thread.is_alive():
            self.finished_clean = False
            if session is not None and session.call is not None:
                session.call.cancel()
            self._thread.join(1.0)
        self.finished_clean = self.finished_clean and left == 0
        return left

    # --- the sender's thread ------------------------------------------------------------------

    def _work(self) -> None:
        back_off_s = FIRST_BACK_OFF_S
        while True:
            session = _Session(self._run)
            code, detail = self._run_session(session)
            with self._changed:
                if self._session is session:
                    self._session = None
                broken = code in _BROKEN_NAMES
                lost = session.newest_frame if session.acked_frames < session.sent_frames else None
                if broken and lost is not None and not self._queue and not self._abandon:
                    # Nothing newer will tell where the agents are, so the last frame goes once more;
                    # a server that had it calls it late.
                    self._queue.append(lost)
                    self._queued_bytes += lost.size_bytes
                if self._abandon or (self._closing and not self._queue):
                    self.finished_clean = session.completed and code is None
                    return
                next_run = self._queue[0].run if self._queue else session.run
            if session.accepted:
                back_off_s = FIRST_BACK_OFF_S
            if session.completed and code is None:
                self._run = next_run  # time went back
                continue
            elif code is not None and self._drop_environment(session, code, detail):
                back_off_s = FIRST_BACK_OFF_S
            elif code is not None:
                self._report(f"rpc-{code}", f"publish: {self._said(code, detail)}")
                self._reclaim = session.accepted and broken
                if code in _REFUSED_NAMES:
                    back_off_s = max(back_off_s, 1.0)
            # Full jitter: many producers of one server must not come back all at once.
            self._sleep(back_off_s * random.uniform(0.5, 1.0))
            back_off_s = min(2 * back_off_s, LAST_BACK_OFF_S)

    def _drop_environment(self, session: _Session, code: str, detail: str) -> bool:
        """Whether the server ended a stream for what stands around the agents: they go on without it."""
        if code not in ("INVALID_ARGUMENT", "RESOURCE_EXHAUSTED"):
            return False
        # the server's words, or gRPC's of a message too long for any of its fields to be looked at
        if "environment.walkable_area_wkt" not in detail and "larger than max" not in detail:
            return False
        with self._changed:
            if self._environment is None or session.environment_version < 0:
                return False
            if session.environment_version == self._environment_version:
                self._environment = None
        self._report("environment", f"publish: crowd {self._crowd!r} is shown without its surroundings: {detail}")
        return True

    def _said(self, code: str, detail: str) -> str:
        """What went wrong with a stream, and what to do about it."""
        target = self._endpoint.target
        if code in ("UNAVAILABLE", "DEADLINE_EXCEEDED"):
            if _answers_http(target):
                return (f"{target} answers HTTP: that is the address of a page (--http); give connect, or THRONG_URL, "
                        "the server's (--listen, usually 127.0.0.1:7447)")
            return (f"no throng server answers at {target}; start one with 'throng-server', or give connect, or "
                    f"THRONG_URL, another address. It is tried again meanwhile. ({detail})")
        return f"crowd {self._crowd!r} at {target}: {code}: {detail}"

    def _sleep(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        with self._changed:
            while not self._abandon:
                left = until - time.monotonic()
                if left <= 0:
                    return
                self._changed.wait(left)

    def _run_session(self, session: _Session):
        """Runs one stream to its end. Returns (None, "") or the status code's name and its text."""
        channel = None
        try:
            channel = self._endpoint.channel()
            stub = ingest_pb2_grpc.IngestServiceStub(channel)
            session.waiting_since = time.monotonic()
            call = stub.PublishAgents(self._requests(session), metadata=self._endpoint.metadata)
            with self._changed:
                session.call = call
                self._session = session
                if self._abandon:
                    call.cancel()
            for response in call:
                self._answer(session, response)
            return None, ""
        except grpc.RpcError as error:
            code = error.code().name if hasattr(error, "code") and error.code() is not None else "UNKNOWN"
            return code, error.details() if hasattr(error, "details") else str(error)
        except Exception as error:  # a certificate that can't be read, a library that fails
            return type(error).__name__, str(error)
        finally:
            with self._changed:
                session.ended = True
                self._changed.notify_all()
            if channel is not None:
                channel.close()

    def _answer(self, session: _Session, response: ingest_pb2.PublishAgentsResponse) -> None:
        kind = response.WhichOneof("message")
        with self._changed:
            if kind == "start":
                session.accepted = True
                session.waiting_since = None
                session.chunk_bytes = max(response.start.max_chunk_bytes or _DEFAULT_CHUNK_BYTES, _MIN_CHUNK_BYTES)
                session.max_agents = response.start.max_agents
                self._counts["connections"] += 1
            elif kind == "frame":
                ack = response.frame
                outcomes = ingest_pb2.FrameAck
                session.acked_frames += 1
                session.waiting_since = None if session.acked_frames >= session.sent_frames else time.monotonic()
                self._counts["viewers"] = ack.viewers
                if ack.outcome == outcomes.OUTCOME_APPLIED:
                    self._counts["applied"] += 1
                elif ack.outcome == outcomes.OUTCOME_LATE:
                    self._counts["late"] += 1
                elif ack.outcome == outcomes.OUTCOME_INCOMPLETE:
                    self._counts["incomplete"] += 1
                elif ack.outcome == outcomes.OUTCOME_UNKNOWN_EPOCH:
                    self._counts["unknown_epoch"] += 1
                    if ack.frame_index >= session.first_frame_of_epoch:
                        session.resend_membership = True
            self._changed.notify_all()

    # --- the request iterator, on a gRPC thread -------------------------------------------------

    def _requests(self, session: _Session) -> Iterator[ingest_pb2.PublishAgentsRequest]:
        try:
            yield self._start_message(session)
            with self._changed:
                while not (session.accepted or session.ended or self._abandon):
                    self._changed.wait()
            while True:
                environment = None
                frame = None
                with self._changed:
                    while True:
                        if session.ended or self._abandon:
                            return
                        if session.environment_version != self._environment_version:
                            session.environment_version = self._environment_version
                            environment = self._environment
                            if environment is not None:
                                break
                        if self._queue:
                            if self._queue[0].run != session.run:
                                session.completed = True
                                return  # half-close: the next stream is the next run
                            frame = self._queue.popleft()
                            self._queued_bytes -= frame.size_bytes
                            break
                        if self._closing:
                            session.completed = True
                            return
                        self._changed.wait()
                if environment is not None:
                    yield ingest_pb2.PublishAgentsRequest(
                        environment=ingest_pb2.Environment(walkable_area_wkt=environment))
                if frame is not None:
                    yield from self._frame_messages(session, frame)
        except Exception as error:  # else gRPC would log a bare traceback and cancel
            self._report("sender", f"publish: {type(error).__name__}: {error}")
            raise

    def _start_message(self, session: _Session) -> ingest_pb2.PublishAgentsRequest:
        x, y, z = (float(value) for value in self._origin_m)
        run_id = self._run_id if session.run == 0 else f"{self._run_id}.{session.run}"
        return ingest_pb2.PublishAgentsRequest(start=ingest_pb2.StartPublishing(
            crowd_name=self._crowd, run_id=run_id, origin=common_pb2.Vec3(x=x, y=y, z=z),
            channels=[common_pb2.Channel(name=name, unit=unit) for name, unit in self._channels.items()],
            seed=self._seed, take_over=self._take_over or self._reclaim, producer=self._producer,
            expected_rate_hz=self._rate_hz))

    def _frame_messages(self, session: _Session, frame: Frame) -> Iterator[ingest_pb2.PublishAgentsRequest]:
        count = frame.positions.shape[0]
        if session.max_agents and count > session.max_agents:
            self._report("max-agents", f"publish: {count} agents, the server takes {session.max_agents}; "
                                       "frames are left out until there are fewer")
            return
        if session.membership is not frame.membership or session.resend_membership:
            session.resend_membership = False
            session.membership = frame.membership
            self._epoch += 1  # rises over all streams, so that no server mistakes one for another
            session.first_frame_of_epoch = self._frame_index + 1
            with self._changed:
                self._counts["memberships"] += 1
            yield ingest_pb2.PublishAgentsRequest(membership=ingest_pb2.Membership(
                epoch=self._epoch, ids=frame.membership.ids.astype("<u8", copy=False).tobytes(),
                names=frame.membership.names or ()))

        self._frame_index += 1
        row_bytes = 12 + 4 * len(frame.channels)
        row_bytes += 0 if frame.motions is None else 1
        row_bytes += 4 if frame.headings is not None else 16 if frame.quaternions is not None else 0
        names_bytes = sum(len(name.encode("utf-8")) + 4 for name in frame.motion_names)
        rows = max(1, (session.chunk_bytes - _CHUNK_OVERHEAD_BYTES - 8 * len(frame.channels) - names_bytes)
                   // row_bytes)
        with self._changed:
            self._counts["sent"] += 1
            session.newest_frame = frame
            session.sent_frames += 1
            if session.waiting_since is None:
                session.waiting_since = time.monotonic()
        for first in range(0, max(count, 1), rows):
            part = slice(first, first + rows)
            chunk = ingest_pb2.AgentChunk(
                frame_index=self._frame_index, scene_time_us=frame.time_us, epoch=self._epoch, first_agent=first,
                positions=_wire(frame.positions[part]), channels=[_wire(column[part]) for column in frame.channels])
            if frame.headings is not None:
                chunk.headings = _wire(frame.headings[part])
            elif frame.quaternions is not None:
                chunk.quaternions = _wire(frame.quaternions[part])
            if frame.motions is not None:
                chunk.motions = frame.motions[part].tobytes()
                chunk.motion_names.extend(frame.motion_names)
            yield ingest_pb2.PublishAgentsRequest(chunk=chunk)


def _answers_http(target: str) -> bool:
    """Whether HOST:PORT speaks HTTP/1, as the page's door does and a gRPC server does not."""
    host, _, port = target.rpartition(":")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), timeout=0.7) as door:
            door.settimeout(0.7)
            door.sendall(b"HEAD / HTTP/1.0\r\n\r\n")
            return door.recv(7) == b"HTTP/1."
    except (OSError, ValueError):  # ValueError: a name that no host can have
        return False


def _wire(column: np.ndarray) -> bytes:
    return column.astype("<f4", copy=False).tobytes()
