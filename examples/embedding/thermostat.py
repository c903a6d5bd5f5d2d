"""A room, simulated, and its thermostat: the graph that `web.py`, `window.py` and `notebook.ipynb` run inside of them.

    room ── temperature ──> thermostat ── power (an event that sets a parameter of the room)

Run only the graph with `hfg run examples/embedding/thermostat.py --clock virtual --until 60`.
"""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Le

import hfg

RATE_HZ = 10.0


class Room(hfg.Node):
    """A room that loses a hundredth of its surplus of heat per second.

    Attributes:
      temperature: in degrees Celsius.
      power: of the heating, in degrees per second.
    """

    temperature = hfg.Output(float)
    power = hfg.Parameter(0.0, Ge(0))
    warmth = hfg.State(15.0)
    has_contact = hfg.State(True)

    def process(self) -> float:
        if not self.has_contact:
            raise ConnectionError("the sensor in the room has no contact")
        self.warmth += (self.power - (self.warmth - 10.0) / 100.0) / RATE_HZ
        return round(self.warmth, 3)

    @hfg.slot
    def unplug(self) -> None:
        """Take the sensor away: the next reading fails."""
        self.has_contact = False


@hfg.node
def thermostat(temperature: float, *, target: Annotated[float, Ge(5), Le(30)] = 20.0) -> float:
    """Heat the more, the colder it is; in degrees per second."""
    return min(max(0.2 * (target - temperature), 0.0), 1.0)


def build(name: str = "room") -> hfg.Graph:
    graph = hfg.Graph(name)
    room = graph.add(Room(), max_rate_hz=RATE_HZ)
    control = graph.add(thermostat())
    graph.connect(room.temperature, control.ports.inputs["temperature"])
    graph.connect(control.out.sent, room.ports.parameters["power"])
    return graph
