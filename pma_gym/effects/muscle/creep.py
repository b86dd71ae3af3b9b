"""Creep of rubber and braid: a Maxwell branch parallel to the muscle (Zener 1948).

A standard linear solid is a spring parallel to a Maxwell branch (a second spring in series with a
dashpot). The first spring is the muscle's force law; this file has the branch. A fast and a slow
branch cover creep within seconds and within a minute.
"""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.units import Quantity

_SHARE = "literature on braided muscles: 1-5 % of the force; 3 % of 20 N/mm is 0.6"


class Creep(NamedTuple):
    """Parameters of the fast branch."""

    stiffness: Annotated[float, Quantity("N/mm", 0, 20, _SHARE, 0.0, usual=0.6)]
    time_constant: Annotated[
        float, Quantity("s", 0.1, 10, "literature on braided muscles: 1-3 s; start from 2", usual=2)
    ]


class SlowCreep(NamedTuple):
    """Parameters of the slow branch."""

    stiffness: Annotated[float, Quantity("N/mm", 0, 20, _SHARE, 0.0, usual=0.6)]
    time_constant: Annotated[
        float,
        Quantity("s", 5, 500, "literature on braided muscles: 20-60 s; start from 40", usual=40),
    ]


def creep_force(memory):
    """Force of the branch on the slide.

        F = -f

    Args:
        memory: force f in the branch (N), 0 in a rested muscle.
    Returns:
        Force (N); positive shortens the muscle.
    Source:
        Standard linear solid (C. Zener 1948); this is its branch with the dashpot.
    """
    return -memory


def creep_rate(velocity, p):
    """Rate of the force in the branch: f' = stiffness x' - f / time_constant.

    The dashpot dissipates f^2 / (stiffness time_constant), never negative. At zero stiffness f
    stays exactly 0.

    Args:
        velocity: rate of contraction x' (m/s).
        p: Creep or SlowCreep: stiffness (N/m), time_constant (s).
    Returns:
        (source, decay) with f' = source - decay * f (N/s).
    """
    return p.stiffness * velocity, 1.0 / p.time_constant


_SIGNATURE = "relaxes exponentially while held; the area of a loop peaks at one rate"

CREEP = Effect(
    name="creep",
    port="muscle_force",
    parameters=Creep,
    law=creep_force,
    rate=creep_rate,
    signature=f"{_SIGNATURE}, that of some seconds",
    memory_scale=10.0,
)
SLOW_CREEP = Effect(
    name="slow_creep",
    port="muscle_force",
    parameters=SlowCreep,
    law=creep_force,
    rate=creep_rate,
    signature=f"{_SIGNATURE}, that of a minute; a drift within a trial",
    memory_scale=10.0,
)
