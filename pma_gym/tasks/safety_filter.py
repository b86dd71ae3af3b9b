"""The safety layer of an exercise: the pressure that it lets through.

It stands between whoever commands the regulator and the regulator, reads the sensors and knows the
nominal device, and holds the pressure that is asked for within

    P - fall  <=  P_asked  <=  P + rise
    h fall = min(b (s v_safe - v) - (M_slow - M), a max(0, M - M_slack))
    h rise = min(b (s v_safe + v) + (M_slow - M), g (m M_safe - M))
    b is k times as great where s v_safe is exceeded

P is the pressure that the nominal regulator has come to by what was let through before: a pressure
by the transducer, whose error the layer would follow, would drift. v is the joint's speed, M its
moment, M_slow the moment of late, which is what the operator gives, and h the change of the moment
by the pressure, linear in the angle. A pressure that falls lets the operator run ahead, one that
rises pulls his leg back. What is let through is what would bring the joint, from its speed and
with the moment that is not balanced yet, to the share s of the safe speed within I / b, I the
leg's inertia. The pressure never falls so far that the cable would hang slack, which would let him
run without any resistance. Where moment and speed disagree the moment counts.

Source:
    Our own. The form is that of a control barrier function (A. D. Ames and others 2017, "Control
    barrier function based quadratic programs for safety critical systems"); the numbers were found
    by simulation, and `python -m benchmarks safety` measures their effect.
"""

from typing import Any, NamedTuple

from pma_gym.codegen.generic import where
from pma_gym.plant.exercise_device.device import FULL_ANGLE
from pma_gym.units import SI_FACTORS

SPEED_FILTER_S = 0.04
"""Time constant of the speed that is found from the extension (s)."""

MOMENT_FILTER_S = 0.15
"""Time constant of the moment of late (s)."""


class SafetyFilter(NamedTuple):
    """Numbers of the safety layer.

    Attributes:
        speed_share: share s of the safe speed that the joint may be on its way to.
        speed_reserve: moment that may be unbalanced for each rad/s that is left, b (N m s/rad).
        moment_share: share m of the safe moment.
        moment_reserve: moment let through for each N m that is left, g.
        taut_share: share of the moment that may be let go, a.
        slack_moment: moment that a load cell may show without any (N m), M_slack.
        brake: how much harder the pressure turns beyond the speed's share, k.
        start_influence: change of the moment by the pressure at 0 deg, h (N m/Pa). With a taut
            cable the nominal device has 0.016-0.035 N m/kPa there, by the pressures.
        end_influence: the same at 90 deg, where it has 0.04-0.07, so that less is let through.
    """

    speed_share: float
    speed_reserve: float
    moment_share: float = 0.85
    moment_reserve: float = 0.5
    taut_share: float = 0.4
    slack_moment: float = 0.2
    brake: float = 4.0
    start_influence: float = 0.03 / SI_FACTORS["kPa"]
    end_influence: float = 0.08 / SI_FACTORS["kPa"]


FILTER_PACED = SafetyFilter(speed_share=0.45, speed_reserve=2.0)
"""Where the device sets the pace: the operator's joint is slack, and whatever is not balanced moves
it."""

FILTER_PACING = SafetyFilter(speed_share=0.5, speed_reserve=1.2)
"""Where the operator keeps the pace with a stiff joint."""


def filtered_pressure(
    asked: Any,  # noqa: ANN401
    pressure: Any,  # noqa: ANN401
    moment: Any,  # noqa: ANN401
    slow: Any,  # noqa: ANN401
    speed: Any,  # noqa: ANN401
    angle: Any,  # noqa: ANN401
    safe_moment: float,
    safe_speed: float,
    safety_filter: SafetyFilter,
) -> Any:  # noqa: ANN401
    """Pressure that the safety layer commands; numbers or traced values.

    Args:
        asked: pressure that is asked for (Pa).
        pressure: that the nominal regulator has come to (Pa).
        moment: at the joint, by load cell and pulley (N m).
        slow: moment of late (N m).
        speed: of the joint (rad/s).
        angle: of the joint (rad).
        safe_moment: what the moment must not exceed (N m).
        safe_speed: what the speed must not (rad/s).
        safety_filter: its numbers.
    """
    most = safety_filter.speed_share * safe_speed
    share = 1.0 / _influence(angle, safety_filter)
    ahead = slow - moment
    falling = (_reserve(most - speed, safety_filter) - ahead) * share
    spare = moment - safety_filter.slack_moment
    taut = safety_filter.taut_share * where(spare > 0.0, spare, 0.0) * share
    falling = where(taut < falling, taut, falling)
    rising = (_reserve(most + speed, safety_filter) + ahead) * share
    room = (
        safety_filter.moment_reserve * (safety_filter.moment_share * safe_moment - moment) * share
    )
    rising = where(room < rising, room, rising)
    lowest, highest = pressure - falling, pressure + rising
    raised = where(asked < lowest, lowest, asked)
    return where(raised > highest, highest, raised)


def _reserve(left: Any, safety_filter: SafetyFilter) -> Any:  # noqa: ANN401
    """Moment that may be unbalanced (N m) where so much speed is left (rad/s)."""
    return safety_filter.speed_reserve * where(left < 0.0, safety_filter.brake * left, left)


def _influence(angle: Any, safety_filter: SafetyFilter) -> Any:  # noqa: ANN401
    """Change of the moment by the pressure at an angle (N m/Pa)."""
    way = angle * (1.0 / FULL_ANGLE)
    clipped = where(way < 0.0, 0.0, where(way > 1.0, 1.0, way))
    return safety_filter.start_influence + clipped * (
        safety_filter.end_influence - safety_filter.start_influence
    )
