"""Voltages of the actuators: their limit, and those at which a trial rests."""

from pma_gym.envs import StationInfo

VOLTAGE_LIMIT = 10.0
"""Largest voltage of motor and regulator (V)."""


def nominal_offset(station: StationInfo) -> float:
    """Voltage (V) that changes nothing of how a trial begins.

    Of the motor the one at which the nominal drive just begins to pull, 0 without a drive; of the
    regulator the one that holds the pressure.
    """
    parameters = station.model.parameters
    if station.task.actuator == "regulator":
        line = parameters["regulator_line"]
        return (station.pressure - line.offset) / line.gain
    drive = parameters.get("drive")
    return max(0.0, -drive.offset / drive.gain) if drive else 0.0


def rest_voltage(station: StationInfo) -> float:
    """Voltage of the task's actuator at rest (V): no pull, or what holds the pressure."""
    return 0.0 if station.task.actuator == "motor" else nominal_offset(station)
