"""A second mass behind a springy coupling: a load on a shaft, a belt, a screw or a gear."""

from typing import Annotated, NamedTuple

from pma_gym.effects.effect import Effect
from pma_gym.effects.muscle.geometric_force import PI
from pma_gym.units import Quantity


class SecondMass(NamedTuple):
    """Parameters of `coupled_acceleration`."""

    share: Annotated[float, Quantity("1", 0, 0.99, "assumption: 0.3", 0.0, usual=0.3)]
    frequency: Annotated[
        float, Quantity("Hz", 0.01, 1000, "assumption: 10, belts and shafts 5-100", usual=10)
    ]
    damping: Annotated[float, Quantity("1", 0, 10, "assumption: 0.05, steel and belts", usual=0.05)]


def coupled_acceleration(acceleration, memory, p):
    """Acceleration of the mass at the drive, which the sensors read and all forces act on.

        a1 = a / (1 - share) + share w (e + 2 damping u),   w = 2 pi frequency

    Without damping its resonance is w, and it stands still at w sqrt(1 - share).

    Args:
        acceleration: a of both masses if they were one (m/s^2, rad/s^2).
        memory: w times the deflection of the coupling, e, and the deflection's rate u (m/s, rad/s).
        p: SecondMass: share of the whole mass or inertia behind the coupling, natural frequency
            (Hz) and damping ratio of the free axis.
    Returns:
        Acceleration (m/s^2, rad/s^2).
    Source:
        Two-mass system: G. Ellis, R. D. Lorenz 2000, "Resonant load control methods for industrial
        servo drives", IEEE Industry Applications Conference.
    """
    circular = 2.0 * PI * p.frequency
    pull = circular * (memory[0] + 2.0 * p.damping * memory[1])
    return acceleration / (1.0 - p.share) + p.share * pull


def deflection_rates(acceleration, memory, p):
    """Rates of the deflection: e' = w u and u' = -w (e + 2 damping u) - a / (1 - share).

    Args:
        acceleration: a of both masses if they were one (m/s^2, rad/s^2).
        memory: e and u, see `coupled_acceleration`.
        p: SecondMass.
    Returns:
        (source, decay) of both, with memory' = source - decay * memory.
    Source:
        See `coupled_acceleration`.
    """
    circular = 2.0 * PI * p.frequency
    push = acceleration / (1.0 - p.share) + circular * memory[0]
    return (circular * memory[1], 0.0 * p.share), (-push, 2.0 * p.damping * circular)


SECOND_MASS = Effect(
    name="second_mass",
    port="coupling",
    parameters=SecondMass,
    law=coupled_acceleration,
    rate=deflection_rates,
    memories=2,
    memory_scale=16e-3,
    signature=(
        "resonance at a fixed frequency, at every place and speed; below it the axis hardly moves "
        "at sqrt(1 - share) of it, far above it the axis is lighter"
    ),
)
