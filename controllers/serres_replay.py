"""The voltages that the dissertation printed."""

import math

import numpy as np

from controllers.registry import Reference
from controllers.serres_feedforward import VoltageTable
from pma_gym.data.serres2008 import load_table, pressures
from pma_gym.envs import StationInfo
from pma_gym.tasks import TASKS


class SerresReplay(VoltageTable):
    """The voltages that the dissertation printed, unchanged.

    They follow the task's own reference, whatever reference is given, and exist at the pressures
    of the dissertation's trials alone. Those of rotation were computed for 45 mm at 90 deg.

    Source:
        Serres 2008, tables I4-I20.
    """

    name = "serres_replay"

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Look up the profile of the trial.

        Raises:
            ValueError: no profile was printed for this task or pressure; says for which one was.
        """
        if station.task.name not in TASKS:
            raise ValueError(
                f"the dissertation printed voltages of the tasks {' and '.join(TASKS)}, not of "
                f"{station.task.name}; take serres_feedforward for another extension or rotation, "
                "or another controller"
            )
        task, pressure_kpa = station.task.name, station.pressure / 1e3
        known = pressures(task)
        if not any(math.isclose(pressure_kpa, one) for one in known):
            raise ValueError(
                f"the dissertation printed voltages of the {task} task for "
                f"{', '.join(map(str, known))} kPa, not for {pressure_kpa:g} kPa; "
                "use serres_feedforward, which computes them for any pressure in 150-575 kPa"
            )
        self._period = station.period
        self.times, self.volts = printed_voltages(task, round(pressure_kpa))


def printed_voltages(task: str, pressure_kpa: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and motor voltages (V) of a printed profile.

    Args:
        task: `displacement` or `rotation`.
        pressure_kpa: one of `pressures(task)`.

    >>> times, volts = printed_voltages("displacement", 150)
    >>> float(times[1]), float(volts[1])
    (0.2, 0.122178)
    """
    first = 4 if task == "displacement" else 13
    table = load_table(f"I{first + pressures(task).index(pressure_kpa)}")
    return table["time_s"], table["motor_voltage_v"]
