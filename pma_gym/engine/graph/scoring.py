"""Score of a running episode: the position at 384 Hz, interpolated between internal steps."""

from collections.abc import Mapping
from dataclasses import dataclass

from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.graph import CHANGING, HELD, Graph, Value
from pma_gym.codegen.trace import substitute
from pma_gym.engine.observation import Prescribed
from pma_gym.engine.state_layout import START, profile_at_offsets
from pma_gym.integrator.equations import Equations
from pma_gym.integrator.step_attempt import StepAttempt
from pma_gym.metrics import SAMPLE_RATE_HZ
from pma_gym.tasks import MomentProfile, Task

SAMPLE_PERIOD = 1.0 / SAMPLE_RATE_HZ
"""Time between two samples (s), at every control rate."""


@dataclass(frozen=True)
class Course:
    """Course of the position during a step attempt, as traced values.

    Attributes:
        start: position at its beginning (m or rad).
        speed: its rate there.
        acceleration: the rate's rate there.
        end: position at its end.
        end_speed: its rate there.
    """

    start: Value
    speed: Value
    acceleration: Value
    end: Value
    end_speed: Value

    @property
    def values(self) -> list[Value]:
        """All of them."""
        return [self.start, self.speed, self.acceleration, self.end, self.end_speed]


def course(eq: Equations, attempt: StepAttempt, position: Value) -> Course:
    """Course of a position during a step attempt."""
    speed = _rate(eq, position)
    acceleration = _rate(eq, speed)
    begin = {**attempt.frozen, **attempt.here}
    start = substitute([position, speed, acceleration], begin)
    end = substitute([position, speed], {**attempt.frozen, **attempt.moved})
    return Course(*start, *end)


def position_of(eq: Equations, task: Task, outputs: Mapping[str, Value]) -> Value:
    """Position of the task's controlled quantity (m or rad), from the plant's outputs.

    Of an exercise that prescribes a moment it is the moment's excess (N m).
    """
    if task.schedule.followed.lengthens:
        return eq["zero_contraction"] - outputs["contraction"]
    if task.schedule.followed.shortens:
        return outputs["contraction"] - eq.graph.input(START, HELD)
    if task.schedule.followed.is_force:
        radius = eq.parameters["rotor"].radius
        return Prescribed(radius, held_plan(eq, task)).excess(outputs["load"], outputs["rotation"])
    return outputs["rotation"]


def held_plan(eq: Equations, task: Task) -> MomentProfile:
    """Moment that an exercise prescribes over the angle, as constant inputs of a step."""
    assert task.exercise is not None
    return profile_at_offsets(lambda name: eq.graph.input(name, HELD), task.exercise)


def _rate(eq: Equations, value: Value) -> Value:
    (slopes,) = derivatives([value], [state.value for state in eq.states])
    total = eq.graph.constant(0.0)
    for slope, state in zip(slopes, eq.states, strict=True):
        if slope is not None:
            total = total + slope * state.rate
    return total


@dataclass(frozen=True)
class Sampling:
    """One sample that may lie in an attempt, as traced values of a graph of their own inputs.

    Attributes:
        due: whether it lies there.
        position: the position at it (m or rad).
        sample: number of the next one.
        sums: sums of squared errors by phase, with it if it is due.
        when: time from the attempt's beginning to it (s): a difference of times since the trial
            began, for which single precision is too little.
        done: how much of the control step lies before the attempt (s).
        ideal: ideal position at it (m or rad), an input that the sums need; None where they know it
            from lines.
    """

    due: Value
    position: Value
    sample: Value
    sums: list[Value]
    when: Value
    done: Value
    ideal: Value | None = None


def sampling(graph: Graph, left: Value, task: Task, period: float) -> Sampling:
    """A sample in an attempt, from `course` and the record's numbers given as inputs.

    The quartic through both ends' positions and rates, and the first's second rate: its error goes
    with the fifth power of the step, as the integrator's own.

    Args:
        graph: the graph that it is to stand in.
        left: time left of the control step where the attempt begins (s).
        task: the task.
        period: duration of the control step (s).
    """
    c = Course(*(graph.input(f"course.{name}", CHANGING) for name in COURSE))
    sample, clock = graph.input("record.sample", CHANGING), graph.input("clock", HELD)
    length = graph.input("length", CHANGING)
    done = period - left
    when = sample * SAMPLE_PERIOD - clock - done
    share = when * (1.0 / length)
    due = attempt_due(graph.input("accepted", CHANGING, "truth"), share)
    b, d = c.speed * length, 0.5 * c.acceleration * (length * length)
    # p(s) = start + b s + d s^2 + e s^3 + f s^4 with p(1) = end and p'(1) = end_speed * length.
    rest = c.end - c.start - b - d
    slope = c.end_speed * length - b - 2.0 * d
    e, f = 4.0 * rest - slope, slope - 3.0 * rest
    position = c.start + share * (b + share * (d + share * (e + share * f)))
    sums = []
    moved = None if task.schedule.motion is None else graph.input("ideal", CHANGING)
    for phase in task.schedule.phases:
        before = graph.input(f"record.sum_{phase.name}", CHANGING)
        first = float(phase.first)
        line = phase.initial + phase.slope * ((sample - first) * SAMPLE_PERIOD)
        error = position - (line if moved is None else moved)
        inside = due & (sample >= first) & (sample < first + phase.samples)
        sums.append(graph.select(inside, before + error * error, before))
    following = graph.select(due, sample + 1.0, sample)
    return Sampling(due, position, following, sums, when, done, moved)


COURSE = ("start", "speed", "acceleration", "end", "end_speed")
"""Names of a course's values."""


def attempt_due(accepted: Value, share: Value) -> Value:
    """Whether a sample lies in an accepted attempt, its end included."""
    return accepted & (share <= 1.0 + 1e-6)
