"""Open loop: the voltage that the inverse of the nominal model gives for the reference."""

from controllers.models.nominal_motion import NominalMotion, nominal_motion
from controllers.models.voltage import VOLTAGE_LIMIT
from controllers.registry import Reference
from pma_gym.envs import Measurement, StationInfo


class ImprovedFeedforward:
    """The voltage that the nominal model needs for the reference, one value a control period.

        V = map^-1(y_ref) + lag compensation

    What it mends of the dissertation's feed-forward: the lag is inverted in continuous time, so
    there is no root at z = -1 and the voltage does not alternate; the map is the model's own
    balance of forces, neither a quadratic nor rounded; the drive's dead zone and the cable's
    slack are passed at once; voltages belong to control periods, not to 0.2 s. See
    `controllers.models.inverse` for the derivation. Where the model needs less than 0 or more than
    10 V it asks for the limit.

    It sees no sensor: what the model does not know stays as error.
    """

    name = "improved_feedforward"

    def __init__(self) -> None:
        self._motion: NominalMotion | None = None

    def reset(self, reference: Reference, station: StationInfo) -> None:
        """Compute the voltages of the whole trial, or take them as computed before."""
        self._motion = nominal_motion(reference, station)

    def act(self, measurement: Measurement, time: float) -> float:
        """Voltage (V) to send now, for it is in force the action delay later."""
        assert self._motion is not None, "reset comes first"
        return min(max(self._motion.command(time), 0.0), VOLTAGE_LIMIT)

    def voltage(self, time: float) -> float:
        """Voltage (V) that the motion needs in force at a time (s), also beyond the limits.

        After the trial's end that of the last period.
        """
        assert self._motion is not None, "reset comes first"
        return self._motion.voltage(time)
