"""JuPedSim: publish a simulation through its trajectory writer interface.

    simulation = jupedsim.Simulation(model=..., geometry=...,
        trajectory_writer=Tee(SqliteTrajectoryWriter(output_file=path), ThrongWriter(pub)))

JuPedSim takes one writer for a simulation; `Tee` makes one of several.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from jupedsim.serialization import TrajectoryWriter

if TYPE_CHECKING:
    from throng import Publisher


class ThrongWriter(TrajectoryWriter):
    """Publishes every `every`-th iteration of a JuPedSim simulation, and its walkable area.

    Args:
        pub: a publisher in JuPedSim's own units and axes, which are `throng.connect`'s defaults.
        every: iterations between two frames. Default: about 25 frames per simulated second.
        headings: True publishes the model's orientation. By default the server takes the heading from
            the motion, because an orientation may turn from one iteration to the next in a dense
            crowd, and JuPedSim 2 has none.

    Like `Publisher.publish`, nothing here raises into the simulation.
    """

    def __init__(self, pub: "Publisher", every: Optional[int] = None, headings: bool = False) -> None:
        if every is not None and every < 1:
            raise ValueError(f"ThrongWriter: every is {every}, must be >= 1")
        self._pub = pub
        self._every = every
        self._headings = headings

    def every_nth_frame(self) -> int:
        return self._every or 4  # JuPedSim's own default, 25 Hz at its default step

    def begin_writing(self, simulation: Any) -> None:
        step_s = simulation.delta_time()
        if self._every is None:
            self._every = max(1, round(0.04 / step_s))
        self._pub.expect_rate(1.0 / (step_s * self._every))
        self._pub.scene(wkt=simulation.get_geometry().as_wkt())

    def write_iteration_state(self, simulation: Any) -> None:
        if simulation.iteration_count() % self.every_nth_frame():
            return
        # One pass over the agents: each attribute is a call into the simulator.
        rows = [(agent.id, *agent.position) for agent in simulation.agents()]
        ids = np.array([row[0] for row in rows], np.uint64)
        positions = np.array([row[1:] for row in rows], np.float64).reshape(-1, 2)
        directions = None
        if self._headings and rows:
            unknown = (math.nan, math.nan)
            directions = np.array([getattr(agent, "orientation", unknown) for agent in simulation.agents()])
        self._pub.publish(simulation.elapsed_time(), ids, positions, directions)

    def close(self) -> None:
        """Closes the publisher. JuPedSim itself never calls this."""
        self._pub.close()


class Tee(TrajectoryWriter):
    """Several trajectory writers as one. Each writes at its own interval; what one raises gets out."""

    def __init__(self, *writers: TrajectoryWriter) -> None:
        self._writers = writers

    def every_nth_frame(self) -> int:
        """The greatest common divisor of the writers' intervals."""
        return math.gcd(*(writer.every_nth_frame() for writer in self._writers)) or 1

    def begin_writing(self, simulation: Any) -> None:
        for writer in self._writers:
            writer.begin_writing(simulation)

    def write_iteration_state(self, simulation: Any) -> None:
        iteration = simulation.iteration_count()
        for writer in self._writers:
            if iteration % writer.every_nth_frame() == 0:
                writer.write_iteration_state(simulation)

    def close(self) -> None:
        """Closes the writers that can be closed."""
        for writer in self._writers:
            if hasattr(writer, "close"):
                writer.close()
