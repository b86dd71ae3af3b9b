"""Isotonic tasks: the regulator contracts the muscle against a constant load that the motor holds.

An episode begins settled at its pressure and under its load; what is asked for is how far the
muscle shortens from there. The motor's voltage is what the nominal drive needs for the load, and
stays.
"""

from pma_gym.data.motions import triangle
from pma_gym.data.trial_schedule import Phase, TrialSchedule
from pma_gym.tasks.task import Task
from pma_gym.units import SI_FACTORS

_MM, _KPA = SI_FACTORS["mm"], SI_FACTORS["kPa"]

LOWEST_PRESSURE, HIGHEST_PRESSURE = 150 * _KPA, 575 * _KPA
"""Pressures of the station's trials (Pa): table I3."""


def isotonic(
    load: float = 200.0,
    stroke: float = 12.5 * _MM,
    part: float = 2.5,
    start_pressures: tuple[float, float] = (150 * _KPA, 350 * _KPA),
    name: str = "isotonic",
) -> Task:
    """Contract against a load at one speed, stay there, return at that speed: phases I, II, III.

    The speed of the default is that of the dissertation's displacement, 5 mm/s. Its stroke, load
    and pressures are our choice within the station's reach: by table I3 (command of 225 N, 205 N
    measured) the muscle under such a load is contracted by 39.2 mm at 350 kPa and by 55.9 mm at
    575 kPa, so that 12.5 mm are left wherever a trial begins.

    Args:
        load: constant load (N).
        stroke: how far (m).
        part: how long each phase is (s).
        start_pressures: range of the pressures that episodes begin at (Pa).
        name: name of the task.
    """
    slope = stroke / part
    phases = (
        Phase("I", 0.0, part, initial=0.0, slope=slope),
        Phase("II", part, part, initial=stroke, slope=0.0),
        Phase("III", 2.0 * part, part, initial=stroke, slope=-slope),
    )
    schedule = TrialSchedule(name, "contraction", "mm", stroke, phases)
    return _task(schedule, load, start_pressures)


def pressure_triangle(
    name: str, load: float, pressure: float, stroke: float, period: float, periods: int = 3
) -> Task:
    """Contract and return at one speed, again and again: a phase is a period.

    Args:
        name: name of the task.
        load: constant load (N).
        pressure: pressure that it begins at (Pa).
        stroke: how far (m).
        period: time there and back (s).
        periods: how often; 1 to 9.
    """
    motion = triangle(stroke, period, periods)
    phases = tuple(
        Phase(numeral, k * period, period, 0.0, 0.0, motion)
        for k, numeral in zip(range(periods), _NUMERALS, strict=False)
    )
    schedule = TrialSchedule(name, "contraction", "mm", stroke, phases)
    return _task(schedule, load, (pressure, pressure))


_NUMERALS = ("I", "II", "III", "IV", "V", "VI", "VII", "VIII", "IX")


def _task(schedule: TrialSchedule, load: float, starts: tuple[float, float]) -> Task:
    pressures = LOWEST_PRESSURE, HIGHEST_PRESSURE
    return Task(schedule.name, schedule, *pressures, "regulator", load, starts)


ISOTONIC: dict[str, Task] = {
    task.name: task
    for task in (
        isotonic(),
        pressure_triangle("triangle_low", 150.0, 150 * _KPA, 11.4 * _MM, 4.0),
        pressure_triangle("triangle_high", 400.0, 450 * _KPA, 5.5 * _MM, 10.0),
    )
}
"""Isotonic tasks by name. The triangles are the dissertation's validation trials (Serres 2008,
section 4.1.5, figures 28 and 29: pressure goes up and down between 150 and 250 kPa against 150 N in
4 s, and between 450 and 550 kPa against 400 N in 10 s, three times each), turned into something to
follow: a triangle of the contraction that they had. That is 1.94 mm / 17 % = 11.4 mm and
1.38 mm / 25 % = 5.5 mm, by the printed RMSE and its share of the total contraction (section 5.1.5).
"""
