"""The integrator's step in plain Python, to read, to print and to debug.

    plain = PlainPlant(Plant("station"))
    print(plain.text)                       # the arithmetic, line by line
    for made in plain.attempts(rest, motor_voltage=3.0, regulator_voltage=6.0, duration=0.01):
        print(made.length, made.accepted, made.state)

It makes the same step attempts in the same order as the compiled integration, some hundred times
slower. Compiled code uses fused multiply-add and another order of sums, so the results of a step
differ by a few units in the last place. The differences can grow over a long trial.
"""

import linecache
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType

import numpy as np

from pma_gym.codegen.graph import Value
from pma_gym.codegen.text import python_text
from pma_gym.codegen.trace import live_inputs
from pma_gym.integrator.equations import COMMANDS, ZERO
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import parameter_names
from pma_gym.plant.statics import Condition


@dataclass(frozen=True)
class Made:
    """Result of one step attempt.

    Attributes:
        proposed: proposed size (s).
        left: remaining time of the span before it (s).
        accepted: whether the error was within the tolerance.
        length: size of the attempt (s); time advances only if it is accepted.
        state: state vector after it (SI).
        size: proposed size of the next attempt (s).
        next_left: remaining time of the span after it (s).
        watched: what the plain plant watches.
    """

    proposed: float
    left: float
    accepted: bool
    length: float
    state: np.ndarray = field(repr=False)
    size: float
    next_left: float
    watched: tuple[float, ...] = ()


class PlainPlant:
    """A plant whose rates and steps are plain Python functions.

    Args:
        plant: the compiled plant.
        watched: values of the equations with a zero-order hold to compute in every attempt.

    Attributes:
        plant: the compiled plant.
        text: source of the module: functions `rates` and `attempt`, one operation per line.
        module: the module; replace its functions, or step into them with a debugger.
        arguments: names of each function's inputs, as in the equations.
        parameters: the tolerance and the parameters, by name.
    """

    def __init__(self, plant: Plant, watched: Sequence[Value] = ()) -> None:
        self.plant = plant
        system, made = plant.program.zero_order_hold, plant.program.zero_order_hold.attempt
        stepped = [made.next_size, made.next_left, made.accepted, made.length]
        stepped += [*made.states, *watched]
        functions = {"rates": plant.program.rates(), "attempt": stepped}
        inputs = {name: live_inputs(values) for name, values in functions.items()}
        self.arguments = {name: [i.data for i in values] for name, values in inputs.items()}
        self.states = [entry.name for entry in system.equations.remembered]
        self.text = "\n\n".join(
            python_text(values, inputs[name], name) for name, values in functions.items()
        )
        self.module = ModuleType(f"plain_{plant.model.name}")
        file = f"<{self.module.__name__}>"
        # A debugger shows the lines that it steps through from here.
        linecache.cache[file] = len(self.text), None, self.text.splitlines(keepends=True), file
        exec(compile(self.text, file, "exec"), self.module.__dict__)
        names = ["tolerance", *parameter_names(plant.model)]
        self.parameters = dict(zip(names, map(float, plant.vector), strict=True))

    def derivative(
        self,
        state: np.ndarray,
        motor_voltage: float,
        regulator_voltage: float,
        zero_contraction: float,
    ) -> np.ndarray:
        """Time derivative of the state vector (SI per s), as `Plant.derivative`."""
        known = self._known(state, (motor_voltage, regulator_voltage), zero_contraction)
        return np.array(self._call("rates", known), float)

    def attempt(
        self,
        state: np.ndarray,
        commands: tuple[float, float],
        zero_contraction: float,
        size: float,
        left: float,
    ) -> Made:
        """Make one step attempt.

        Args:
            state: state vector (SI).
            commands: motor and regulator voltage (V).
            zero_contraction: contraction x0 without load at the trial's start (m).
            size: proposed size (s).
            left: remaining time (s).
        """
        known = self._known(state, commands, zero_contraction)
        return self.make(known | {"size": size, "left": left})

    def make(self, known: Mapping[str, float]) -> Made:
        """Make one step attempt from its inputs by name: `arguments["attempt"]`."""
        size, left, accepted, length, *after = self._call("attempt", known)
        state, watched = np.split(np.array(after, float), [len(self.states)])
        return Made(
            known["size"],
            known["left"],
            bool(accepted),
            float(length),
            state,
            float(size),
            float(left),
            tuple(watched.tolist()),
        )

    def attempts(
        self,
        condition: Condition,
        motor_voltage: float,
        regulator_voltage: float,
        duration: float,
    ) -> Iterator[Made]:
        """Yield the attempts of `Plant.step` one by one, and update the condition with each."""
        left, zero = duration, condition.zero_contraction
        condition.receive(motor_voltage, regulator_voltage)
        while left > 0.0:
            voltages = (motor_voltage, regulator_voltage)
            made = self.attempt(condition.state, voltages, zero, condition.size, left)
            condition.state[:], condition.size = made.state, made.size
            if made.accepted:
                condition.time += made.length
            left = made.next_left
            yield made

    def step(
        self,
        condition: Condition,
        motor_voltage: float,
        regulator_voltage: float,
        duration: float,
    ) -> int:
        """Step with constant commands, as `Plant.step`, and return the number of attempts."""
        return sum(1 for _ in self.attempts(condition, motor_voltage, regulator_voltage, duration))

    def _known(
        self, state: np.ndarray, commands: tuple[float, float], zero: float
    ) -> dict[str, float]:
        moving = dict(zip(self.states, map(float, state), strict=True))
        return self.parameters | moving | dict(zip(COMMANDS, commands, strict=True)) | {ZERO: zero}

    def _call(self, name: str, known: Mapping[str, float]) -> tuple:
        function: Callable[..., tuple] = getattr(self.module, name)
        # NumPy's numbers divide by zero as compiled code does: inf or NaN, where a float raises.
        with np.errstate(all="ignore"):
            return function(*(np.float64(known[i]) for i in self.arguments[name]))
