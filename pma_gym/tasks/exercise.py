"""An exercise: an operator turns the joint, the regulator sets what he works against.

The motor plays the operator (`pma_gym.tasks.operator`): out to 90 deg in 5 s, 5 s there, back in
5 s, as in the dissertation's rotation. What the device is to do is prescribed:

    isokinetic    hold the joint's speed at 18 deg/s whatever the operator's effort
    isotonic      hold the moment at the joint
    profile       hold the moment that is prescribed at the joint's angle

Neither moment nor speed may exceed what is safe: an episode ends there, and a safety layer between
agent and regulator keeps away from it (`pma_gym.tasks.safety_filter`).

Source:
    Serres 2008, sections 3.3, 4.3 and 6.3. Moments of the prescriptions, safe moment and safe speed
    are our choice.
"""

from dataclasses import dataclass

from pma_gym.data.trial_schedule import ROTATION
from pma_gym.tasks.operator import MomentProfile, Population
from pma_gym.tasks.safety_filter import SafetyFilter
from pma_gym.units import SI_FACTORS

_DEG = SI_FACTORS["deg"]

PACE = ROTATION
"""Angle that the operator means to have: the dissertation's rotation."""

SAFE_MOMENT = 24.0
"""Moment at the joint that ends an episode (N m): 95 % of the 25.3 N m that the station's motor
holds with 10 V, so that whoever it plays can bear it."""

SAFE_SPEED = 60.0 * _DEG
"""Speed of the joint that ends an episode (rad/s): the slow speed of isokinetic tests, more than
three times the exercise's; an assumption, no standard was found that names one."""

PLAN_ANGLES = tuple(15.0 * _DEG * i for i in range(7))
"""Angles (rad) between which the operator's plan of an isokinetic exercise is linear."""

LOWEST_RATE_HZ = 50.0
"""Control steps a second that the motor needs to play the people that are drawn (Hz), whose joints
have up to 60 N m/rad; a stiffer one needs more."""


@dataclass(frozen=True)
class Exercise:
    """An exercise: its prescription, its operators and its safety limits.

    Attributes:
        prescription: moment over the angle; None where the speed is prescribed.
        population: distribution of the operators.
        safety_filter: numbers of the safety layer.
        safe_moment: largest moment at the joint (N m).
        safe_speed: largest speed of the joint (rad/s).
    """

    prescription: MomentProfile | None
    population: Population
    safety_filter: SafetyFilter
    safe_moment: float = SAFE_MOMENT
    safe_speed: float = SAFE_SPEED

    @property
    def start_moment(self) -> float:
        """Moment that an episode begins with (N m)."""
        return self.prescription.first if self.prescription else 0.0

    @property
    def knots(self) -> int:
        """Knots of the operator's plan."""
        return len(self.prescription.angles if self.prescription else PLAN_ANGLES)

    @property
    def structure(self) -> tuple[object, ...]:
        """The part that compiled environments depend on: no moment, no operator's parameters."""
        prescribed = "speed" if self.prescription is None else "moment"
        return (
            "exercise",
            prescribed,
            self.knots,
            self.safety_filter,
            self.safe_moment,
            self.safe_speed,
        )
