"""SUMO: publish the persons of a simulation that is stepped through traci or libsumo.

    import libsumo as traci                        # or: import traci
    traci.start(["sumo", "-c", "town.sumocfg"])
    with throng.connect(crowd="town") as pub:
        persons = PersonPublisher(pub, traci)
        while traci.simulation.getMinExpectedNumber() > 0:
            traci.simulationStep()
            persons.publish()
"""

from __future__ import annotations

import gzip
import logging
import math
import os
import xml.etree.ElementTree as ET
import zlib
from typing import IO, TYPE_CHECKING, Any, Dict, List, Optional, Tuple, Union, cast

import numpy as np

if TYPE_CHECKING:
    from throng import Publisher


_log = logging.getLogger("throng")
_LANE_WIDTH_M = 3.2  # SUMO's, where a lane has none
_STRIPE_M = 0.5      # of a crossing, and between two
_LONGEST_CROSSING_M = 1000.0
_FARTHEST_M = 1e8
_Line = List[Tuple[float, float]]


def streets(path: Union[str, "os.PathLike[str]"]) -> str:
    """The streets of a SUMO network (.net.xml, .net.xml.gz) as `Publisher.scene` takes them: lanes in
    their width, junctions, what only people walk on and crossings' stripes, each as WKT polygons.

    Raises OSError for a file that can't be read, ValueError for one that is no network.
    """
    surfaces: Dict[str, List[str]] = {"ROAD": [], "WALK": [], "MARK": []}

    def add(surface: str, ring: _Line) -> None:
        if len(ring) >= 3:
            surfaces[surface].append("((" + ",".join(f"{x:.2f} {y:.2f}" for x, y in [*ring, ring[0]]) + "))")

    with open(path, "rb") as start:
        is_packed = start.read(2) == b"\x1f\x8b"
    with gzip.open(path) if is_packed else open(path, "rb") as file:
        root: Optional[ET.Element] = None
        function = ""
        try:
            for event, element in ET.iterparse(cast("IO[bytes]", file), ("start", "end")):
                if root is None:
                    root = element
                    if element.tag != "net":
                        raise ValueError(f"the root element is {element.tag!r}, must be 'net'")
                if event == "start":
                    function = element.get("function", "") if element.tag == "edge" else function
                    continue
                if element.tag == "junction" and element.get("type") != "internal":
                    add("ROAD", _points(element.get("shape", "")))
                elif element.tag == "lane" and function not in ("internal", "connector"):
                    line, width = _points(element.get("shape", "")), float(element.get("width", _LANE_WIDTH_M))
                    if not 0 < width < 1e3:
                        raise ValueError(f"a lane's width is {width}, must be metres")
                    allow = element.get("allow", "")
                    if function == "walkingarea":
                        add("WALK", line)
                    elif function == "crossing":
                        for stripe in _stripes(line):
                            add("MARK", _strip(stripe, width))
                    elif not allow.startswith(("rail", "ship")) and allow != "subway":
                        add("WALK" if allow == "pedestrian" else "ROAD", _strip(line, width))
                if element.tag in ("edge", "junction"):
                    root.clear()
        except (ET.ParseError, ValueError, EOFError, zlib.error) as error:
            raise ValueError(f"{path}: {error}") from None
    text = "".join(f"\n;{name} MULTIPOLYGON ({', '.join(rings)})" for name, rings in surfaces.items() if rings)
    if not text:
        raise ValueError(f"{path}: the network has no lane or junction with a shape")
    return text


def _points(shape: str) -> _Line:
    points: _Line = []
    for word in shape.split():
        try:
            x, y = (float(value) for value in word.split(",")[:2])
        except ValueError:
            x = y = math.nan
        if not (abs(x) <= _FARTHEST_M and abs(y) <= _FARTHEST_M):
            raise ValueError(f"a shape has {word!r}, must be x,y in metres")
        if not points or math.dist(points[-1], (x, y)) > 1e-3:
            points.append((x, y))
    return points


def _strip(line: _Line, width: float) -> _Line:
    """A line's outline, with mitres of at most twice the half width where it bends."""
    if len(line) < 2:
        return []
    at = np.array(line)
    along = np.diff(at, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    aside = np.stack([-along[:, 1], along[:, 0]], axis=1)
    sums = np.concatenate([aside[:1], aside]) + np.concatenate([aside, aside[-1:]])
    out = sums * (2.0 / np.maximum((sums ** 2).sum(axis=1, keepdims=True), 1e-6))
    out *= np.minimum(1.0, 2.0 / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)) * (width / 2)
    return [(float(x), float(y)) for x, y in np.concatenate([at + out, (at - out)[::-1]])]


def _stripes(line: _Line) -> List[_Line]:
    stripes: List[_Line] = []
    for (ax, ay), (bx, by) in zip(line, line[1:]):
        way, at = math.dist((ax, ay), (bx, by)), _STRIPE_M / 2
        if way > _LONGEST_CROSSING_M:
            raise ValueError(f"a crossing is {way:g} m long, at most {_LONGEST_CROSSING_M:g} m is read")
        while at + _STRIPE_M <= way:
            stripes.append([(ax + (bx - ax) * s / way, ay + (by - ay) * s / way) for s in (at, at + _STRIPE_M)])
            at += 2 * _STRIPE_M
    return stripes


class PersonPublisher:
    """Publishes all persons of a running SUMO simulation; call `publish` after each step.

    Positions are metres of the net, headings come from SUMO's angle, whatever `yaw` the publisher was
    made with. Speed goes along as channel "speed" unless the publisher was told other channels.

    Args:
        pub: a publisher with default units and axes.
        traci: the module that steps the simulation, `traci` or `libsumo`, already started.
        riding: True publishes persons inside vehicles too.
        net: the network's file (.net.xml, .net.xml.gz), whose streets are shown; None: the one that
            the simulation says it has, where it can be read from here; "": no streets.
    """

    def __init__(self, pub: "Publisher", traci: Any, riding: bool = False,
                 net: Optional[Union[str, "os.PathLike[str]"]] = None) -> None:
        self._pub = pub
        self._traci = traci
        self._riding = riding
        constants = traci.constants
        self._position, self._angle = constants.VAR_POSITION3D, constants.VAR_ANGLE
        self._speed, self._vehicle = constants.VAR_SPEED, constants.VAR_VEHICLE
        for person in traci.person.getIDList():
            self._subscribe(person)
        try:
            path = traci.simulation.getOption("net-file") if net is None else os.fspath(net)
            if path and (net is not None or os.path.exists(path)):
                pub.scene(streets(path))
        except Exception as error:  # people are shown without their streets
            _log.warning("sumo: no streets: %s", error)

    def publish(self) -> bool:
        """Publishes the present state. Returns True if the frame was queued. Raises only what traci does."""
        traci = self._traci
        # Subscriptions bring everybody's values in one call; a person that has arrived drops out.
        for person in traci.simulation.getDepartedPersonIDList():
            self._subscribe(person)
        results = traci.person.getAllSubscriptionResults()
        if not self._riding:
            results = {person: values for person, values in results.items() if not values[self._vehicle]}
        rows = list(results.values())
        positions = np.array([row[self._position] for row in rows], np.float64).reshape(-1, 3)
        angle_rad = np.radians(np.array([row[self._angle] for row in rows], np.float64))
        channels = {}
        if not self._pub.channels or "speed" in self._pub.channels:
            channels["speed"] = np.array([row[self._speed] for row in rows], np.float32)
        # SUMO turns clockwise from north; a direction has the same meaning for every publisher.
        directions = np.stack([np.sin(angle_rad), np.cos(angle_rad)], axis=1)
        return self._pub.publish(traci.simulation.getTime(), list(results), positions, directions, **channels)

    def _subscribe(self, person: str) -> None:
        self._traci.person.subscribe(person, (self._position, self._angle, self._speed, self._vehicle))
