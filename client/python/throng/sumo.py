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

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from throng import Publisher


class PersonPublisher:
    """Publishes all persons of a running SUMO simulation; call `publish` after each step.

    Positions are metres of the net, headings come from SUMO's angle, whatever `yaw` the publisher was
    made with. Speed goes along as channel "speed" unless the publisher was told other channels.

    Args:
        pub: a publisher with default units and axes.
        traci: the module that steps the simulation, `traci` or `libsumo`, already started.
        riding: True publishes persons inside vehicles too.
    """

    def __init__(self, pub: "Publisher", traci: Any, riding: bool = False) -> None:
        self._pub = pub
        self._traci = traci
        self._riding = riding
        constants = traci.constants
        self._position, self._angle = constants.VAR_POSITION3D, constants.VAR_ANGLE
        self._speed, self._vehicle = constants.VAR_SPEED, constants.VAR_VEHICLE
        for person in traci.person.getIDList():
            self._subscribe(person)

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
