"""The kinds of rig, one file each: their ports, states and balances."""

from pma_gym.plant.rigs.cascade import CASCADE
from pma_gym.plant.rigs.imposed import IMPOSED
from pma_gym.plant.rigs.joint import JOINT
from pma_gym.plant.rigs.muscle_joint import MUSCLE_JOINT, MUSCLE_PAIR
from pma_gym.plant.rigs.rig import Rig
from pma_gym.plant.rigs.slide import SLIDE
from pma_gym.plant.rigs.station import STATION

__all__ = ["RIGS", "Rig"]

RIGS: dict[str, Rig] = {
    rig.name: rig for rig in (STATION, CASCADE, SLIDE, JOINT, IMPOSED, MUSCLE_JOINT, MUSCLE_PAIR)
}
"""All rigs, keyed by the name in `plant = "..."` of a model file."""
