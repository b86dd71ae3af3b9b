"""Disturbances of an episode: jumps of the regulator, hand pushes at the slide."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pma_gym.codegen.random import philox, uniforms
from pma_gym.units import SI_FACTORS

SPACING_S = 2.5
"""An event of each sort comes at a random time in every such part of an episode (s)."""

PULSE_S = 0.2, 0.8
"""Shortest and longest pulse (s); each has a length of its own between them, drawn evenly.

An assumption: how long a person pulls is nobody's constant, and a controller that has learned one
length would be praised for knowing the test.
"""


class Disturbances(NamedTuple):
    """Sizes of an episode's disturbances.

    Attributes:
        regulator_step: by how much the regulator's pressure jumps (Pa); 0 for never.
        hand_push_force: force of a hand's pulses at the slide (N); 0 for none.
    """

    regulator_step: float = 0.0
    hand_push_force: float = 0.0

    def regulator_steps(self, duration: float) -> int:
        """Number of jumps of the regulator in an episode of a duration (s)."""
        return _count(duration) if self.regulator_step else 0

    def pulses(self, duration: float) -> int:
        """Number of pulses in an episode of a duration (s)."""
        return _count(duration) if self.hand_push_force else 0

    def draw(
        self, duration: float, keys: NDArray[np.int64], streams: NDArray[np.int64]
    ) -> "Events":
        """Draw the events of episodes, as a function of their counters.

        Args:
            duration: of an episode (s).
            keys: two words for each, shape (n, 2).
            streams: a word for each, shape (n,).
        """
        steps, pulses = self.regulator_steps(duration), self.pulses(duration)
        shares = _shares(keys, streams, max(steps, pulses))
        lengths = PULSE_S[0] + (PULSE_S[1] - PULSE_S[0]) * shares[4]
        part = duration / max(_count(duration), 1)
        starts = part * np.arange(max(steps, pulses))
        signs = np.where(shares[1] < 0.5, -1.0, 1.0)
        # Away by so much, then back; the next time away in a direction of its own.
        away = np.arange(steps) % 2 == 0
        jumps = np.where(away, signs[:, :steps], -np.roll(signs[:, :steps], 1, axis=1))
        pulse_signs = np.where(shares[3] < 0.5, -1.0, 1.0)
        late = shares[2] * np.maximum(part - lengths, 0.0)
        return Events(
            (starts + shares[0] * part)[:, :steps],
            self.regulator_step * jumps,
            (starts + late)[:, :pulses],
            (self.hand_push_force * pulse_signs)[:, :pulses],
            lengths[:, :pulses],
        )


class Events(NamedTuple):
    """When what disturbs episodes, a row an episode; it comes with the next control step.

    Attributes:
        step_times: when the regulator jumps (s), shape (n, steps).
        step_sizes: by how much (Pa): away from its line and back in turn.
        pulse_times: when pulses begin (s), shape (n, pulses).
        pulse_forces: force on the slide during them (N); positive shortens the muscle.
        pulse_lengths: how long they last (s), shape (n, pulses); an environment rounds up to whole
            control steps.
    """

    step_times: NDArray[np.float64]
    step_sizes: NDArray[np.float64]
    pulse_times: NDArray[np.float64]
    pulse_forces: NDArray[np.float64]
    pulse_lengths: NDArray[np.float64]


def _count(duration: float) -> int:
    return math.floor(duration / SPACING_S)


def _shares(
    keys: NDArray[np.int64], streams: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], ...]:
    """Random numbers between 0 and 1, more than needed for each event, shape (n, count) each."""
    shape = len(streams), count
    words = [np.broadcast_to(keys[:, [i]].astype(np.uint64), shape) for i in range(2)]
    events = np.broadcast_to(np.arange(count, dtype=np.uint64), shape)
    streamed = np.broadcast_to(streams[:, None].astype(np.uint64), shape)
    nothing = np.zeros(shape, np.uint64)
    return tuple(
        share
        for part in (nothing, nothing + 1)
        for share in uniforms(philox((events, streamed, part, nothing), (words[0], words[1])))
    )


_STEP, _FORCE = 25.0 * SI_FACTORS["kPa"], 50.0

DISTURBANCES: dict[str, Disturbances] = {
    "none": Disturbances(),
    "regulator": Disturbances(regulator_step=_STEP),
    "hand_push": Disturbances(hand_push_force=_FORCE),
    "regulator_and_hand_push": Disturbances(_STEP, _FORCE),
}
"""Disturbances of episodes, by name: jumps of the regulator by 25 kPa away from its line and back,
and pulses of 50 N at the slide of 0.2 to 0.8 s, both at random times and of random sign."""
