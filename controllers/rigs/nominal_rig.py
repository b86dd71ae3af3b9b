"""The nominal plant of a rig, stepped by a controller as it expects the rig to move."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pma_gym.envs import RigInfo
from pma_gym.integrator.equations import COMMANDS
from pma_gym.plant.plant import Plant
from pma_gym.plant.simulation import Run, simulate_all
from pma_gym.plant.statics import Condition

Array = NDArray[np.float64]


class NominalRig:
    """A rig's nominal plant, from where its episodes begin.

    Args:
        info: the rig.
    """

    def __init__(self, info: RigInfo) -> None:
        self.info, self.plant = info, Plant(info.model)
        self.rest = info.rest
        self.followed = info.task.schedule.quantity

    def start(self) -> Condition:
        """The condition in which episodes begin."""
        motor, regulator = self.inputs(self.rest)
        return self.plant.settle(motor, regulator_voltage=regulator)

    def inputs(self, commands: Sequence[float] | Array) -> tuple[float, float]:
        """Inputs of the equations for commands (SI)."""
        by_place = {
            c.place: c.at(float(v)) for c, v in zip(self.info.commands, commands, strict=True)
        }
        motor, regulator = (by_place.get(name, 0.0) for name in COMMANDS)
        return motor, regulator

    def held(
        self, condition: Condition, commands: Sequence[float] | Array, duration: float
    ) -> tuple[float, Condition]:
        """The task's signal (SI) and the condition after commands (SI) were held for a time (s)."""
        motor, regulator = self.inputs(commands)
        run = Run(
            np.array([0.0, duration]), np.full(2, motor), np.full(2, regulator), "zoh",
            self.plant.table, condition.state, condition.zero_contraction, condition.size,
        )  # fmt: skip
        simulate_all(self.plant.program, [run])
        after = Condition(
            run.states[1].copy(), condition.zero_contraction, condition.time + duration, run.size
        )
        return self.seen(after)[self.followed], after

    def seen(self, condition: Condition) -> dict[str, float]:
        """True signals (SI) of a condition."""
        truth = self.plant.observe(condition.state[None, :], condition.zero_contraction)
        return {name: float(values[0]) for name, values in truth.items()}
