"""The catalogue: every phenomenon that a plant can have, one file each."""

from pma_gym.effects.cable import CABLE
from pma_gym.effects.contractile_force import CONTRACTILE_FORCE
from pma_gym.effects.coulomb_friction import COULOMB_FRICTION
from pma_gym.effects.damping import DAMPING
from pma_gym.effects.drive import DRIVE
from pma_gym.effects.effect import Effect
from pma_gym.effects.hysteresis import HYSTERESIS
from pma_gym.effects.limits import LIMITS, VALIDITY
from pma_gym.effects.position_map import POSITION_MAP
from pma_gym.effects.regulator import REGULATOR_LAG, REGULATOR_LINE
from pma_gym.effects.rotor import ROTOR
from pma_gym.effects.sensors import LOAD_CELL, LVDT, POTENTIOMETER, PRESSURE_TRANSDUCER
from pma_gym.effects.servo import SERVO, SERVO_INERTIA
from pma_gym.effects.slide import SLIDE
from pma_gym.effects.stiffness import STIFFNESS

CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for effect in (
        CONTRACTILE_FORCE,
        STIFFNESS,
        DAMPING,
        HYSTERESIS,
        COULOMB_FRICTION,
        CABLE,
        DRIVE,
        ROTOR,
        SLIDE,
        REGULATOR_LINE,
        REGULATOR_LAG,
        POSITION_MAP,
        SERVO,
        SERVO_INERTIA,
        LVDT,
        LOAD_CELL,
        PRESSURE_TRANSDUCER,
        POTENTIOMETER,
        LIMITS,
        VALIDITY,
    )
}
"""Effects by name, in the order in which plants add them up."""

__all__ = ["CATALOGUE", "Effect"]
