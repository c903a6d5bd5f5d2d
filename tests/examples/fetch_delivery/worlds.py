"""Worlds in which a robot must deliver although it does not know them: some by name, others by lot."""

from __future__ import annotations

from typing import Final

import numpy as np

from examples.fetch_delivery.world import USUAL, Surroundings

NAMED: Final[dict[str, Surroundings]] = {
    "usual": USUAL,
    "laser 3 cm too far": Surroundings(offset=0.03),
    "laser 3 cm too near": Surroundings(offset=-0.03),
    "laser noise x3": Surroundings(noise=0.03),
    "octagon 5 cm wider": Surroundings(octagon=1.3),
    "octagon -10 %": Surroundings(octagon=1.125),
    "octagon +10 %": Surroundings(octagon=1.375),
    "radius 5.7 m": Surroundings(radius=5.7),
    "radius 6.3 m": Surroundings(radius=6.3),
    "drift x3": Surroundings(drift=3.0),
    "light x0.5": Surroundings(light=0.5),
    "light x1.3": Surroundings(light=1.3),
    "blur x2": Surroundings(blur=2.0),
    "reach 0.40 m": Surroundings(reach=0.4),
}

RANDOM: Final = 20


def drawn(number: int) -> Surroundings:
    """Draw a world by lot: all of it may be other than usual, at once."""
    lots = np.random.default_rng((29, number))
    least = (5.7, 1.125, 1.0, 0.01, -0.03, 0.5, 0.5, 0.4)
    most = (6.3, 1.375, 3.0, 0.03, 0.03, 1.3, 2.0, 0.9)
    names = ("radius", "octagon", "drift", "noise", "offset", "light", "blur", "reach")
    values = (round(float(value), 3) for value in lots.uniform(least, most))
    return Surroundings(**dict(zip(names, values, strict=True)))


def world(name: str) -> Surroundings:
    """Return a world by its name, or "random 7"."""
    return drawn(int(name.split()[1])) if name.startswith("random ") else NAMED[name]
