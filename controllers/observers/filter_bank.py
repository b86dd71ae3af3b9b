"""A bank of Kalman filters, one for each damping that the station may have."""

import numpy as np

from controllers.observers.filter_bank_design import FACTORS, BankDesign
from pma_gym.envs import Measurement

PRIOR = (0.1, 0.2, 0.4, 0.2, 0.1)
"""How likely each of `FACTORS` is before a trial: our assumption."""

MEMORY = 0.98
"""Share of what is held likely that stays from one reading to the next; the rest is `PRIOR` again,
so that a damping that changes on the way is found."""

INNOVATION_GATE = 25.0
"""Square of the innovation, in its standard deviations, beyond which a reading says no more against
a damping: what jumps surprises all."""


class DampingBank:
    """Estimates of the plant's deviations from its nominal motion, by damping.

    Every filter foresees the same reading. By how much it is wrong says how likely its damping is,

        log w <- MEMORY log w + (1 - MEMORY) log prior - (innovation^2 / S + log S) / 2

    and what is predicted is the mean over the dampings by their w.

    At a voltage under which the drive does not pull, it does not pull less: the offset that it is
    estimated to have counts only above.

    Args:
        design: what was computed before the trial.
        period: control period (s).
        pulls: whether the actuator is the motor, which cannot push.

    Attributes:
        estimates: x by damping, shape (M, n), after the last reading.
        taken: period at whose start that was.
    """

    def __init__(self, design: BankDesign, period: float, pulls: bool) -> None:
        self.design, self._period, self._pulls = design, period, pulls
        bank, _, self._states = design.command.shape
        self.estimates = np.zeros((bank, self._states))
        self.taken = -1
        prior = np.array(PRIOR if bank == len(FACTORS) else (1.0,))
        self._prior = np.log(prior)
        self._likely = self._prior.copy()

    @property
    def weights(self) -> np.ndarray:
        """How likely each damping is, shape (M,)."""
        likely = np.exp(self._likely - self._likely.max())
        return likely / likely.sum()

    def moved(self, estimates: np.ndarray, k: int, volts: float) -> np.ndarray:
        """Estimates a period later, shape (M, n).

        Args:
            estimates: at the start of period k.
            k: the period.
            volts: in force in it (V).
        """
        design, motion = self.design, self.design.motion
        change: np.ndarray | float = volts - motion.volts[k]
        if self._pulls:
            offset = estimates[:, design.drive]
            pulling = np.maximum(volts - motion.idle + offset, 0.0)
            # x has the offset's effect already, but where the nominal drive idles.
            known = 0.0 if motion.slackened[k] else offset
            change = (pulling - known - (motion.volts[k] - motion.idle))[:, None]
        return (
            (design.step[:, k] @ estimates[:, :, None])[:, :, 0]
            + design.command[:, k] * change
            + design.drift[:, k]
        )

    def at(self, k: int, sent: list[float]) -> np.ndarray:
        """Estimates at the start of a period to come, shape (M, n).

        Args:
            k: the period.
            sent: voltages in force in the periods so far (V), at least up to that one.
        """
        estimates = self.estimates
        for period in range(max(self.taken, 0), k):
            estimates = self.moved(estimates, period, sent[period])
        return estimates

    def update(self, reading: Measurement, sent: list[float]) -> None:
        """Update the estimates with the sensors' readings; a repeated reading adds nothing.

        Args:
            reading: with the time at which it was taken.
            sent: voltages in force in the periods so far (V), at least up to that time.
        """
        k, design = round(reading.time / self._period), self.design
        if k <= self.taken:
            return
        self.estimates, self.taken = self.at(k, sent), k
        nominal = design.motion.readings[k]
        off = np.array([reading[1], reading[2], reading[4]]) - nominal[[0, 1, 3]]
        innovation = off - self.estimates @ design.sensors.T
        self.estimates = self.estimates + (design.gain[:, k] @ innovation[:, :, None])[:, :, 0]
        variance = design.variance[:, k]
        wrong = np.minimum(innovation[:, design.own] ** 2 / variance, INNOVATION_GATE)
        self._likely = MEMORY * self._likely + (1.0 - MEMORY) * self._prior
        self._likely -= 0.5 * (wrong + np.log(variance))
        self._likely -= self._likely.max()
