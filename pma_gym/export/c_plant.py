"""A model's plant as C99: its expression graph as text, with the integrator's own step."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import resources
from string import Template

from pma_gym.codegen.graph import CHANGING, FIXED, HELD, Value
from pma_gym.codegen.text import C_PREAMBLE, c_text
from pma_gym.codegen.trace import live_inputs, substitute
from pma_gym.data.signals import SIGNALS
from pma_gym.integrator.equations import COMMANDS, ZERO
from pma_gym.integrator.integration import step_start_values
from pma_gym.integrator.step_attempt import first_size
from pma_gym.plant.model import Model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import FIRST_S
from pma_gym.plant.sensors import direct_command


class ExportError(ValueError):
    """A model that cannot be exported; the message says why and the fix."""


@dataclass(frozen=True)
class Variable:
    """A number that the exported plant has a place for.

    Attributes:
        name: `effect.parameter`, a state, a command or a reading.
        unit: of model files and logs; "" where it has none.
        value: at the start (SI).
    """

    name: str
    unit: str
    value: float = 0.0

    @property
    def identifier(self) -> str:
        """The name as C has it."""
        return identifier(self.name)


def identifier(name: str) -> str:
    """Make a C identifier of a name.

    >>> identifier("my axis"), identifier("regulator.rows[0]"), identifier("3-link")
    ('my_axis', 'regulator_rows_0', 'm3_link')
    """
    word = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")
    return word if word[:1].isalpha() else f"m{word}"


def comment(text: str) -> str:
    r"""Make a text of a file that stays within a comment of C.

    >>> comment("a */ b *\\\n/ c")
    'a * / b *\\ / c'
    """
    return " ".join(text.replace("*/", "* /").split())


_SI = {"mm": "m", "um": "m", "in": "m", "ms": "s", "deg": "rad", "kN": "N", "lbf": "N"}
_SI |= {"kip": "N", "kPa": "Pa", "bar": "Pa", "%": "1"}


def si_unit(unit: str) -> str:
    """The SI unit of a unit of files.

    >>> si_unit("N s/mm/kPa"), si_unit("deg/s"), si_unit("1/%"), si_unit("mm^2")
    ('N s/m/Pa', 'rad/s', '1', 'm^2')
    """
    return re.sub(r"[A-Za-z%]+", lambda word: _SI.get(word[0], word[0]), unit).replace("/1", "")


class CPlant:
    """A model's plant as C99.

    Args:
        model: the model.
        commands: at the start, where the plant is settled (V, or the SI unit of the drive's
            command): of the motor and, on a rig with a muscle, of the regulator.

    Attributes:
        name: the C identifier that everything begins with.
        parameters, states, commands, readings: its numbers, in the order of their arrays.
        command: index of the first command among the states.
    Raises:
        ExportError: a rig whose command is a record, or too many commands.
    """

    def __init__(self, model: Model, commands: Sequence[float] = ()) -> None:
        if model.rig.imposes_motion:
            raise ExportError(
                f"model {model.name} imposes a motion, whose record is smoothed as a whole, so no "
                "step knows its command; export a station, a slide or a joint"
            )
        # Ended so that no model is called as a word of C, such as `double`.
        self.model, self.name = model, f"{identifier(model.name)}_plant"
        names = [direct_command(model) or COMMANDS[0], *COMMANDS[1 : 1 + model.rig.has_muscle]]
        if len(commands) > len(names):
            raise ExportError(
                f"commands at the start must be {', '.join(names)}, got {len(commands)} numbers"
            )
        plant = self.plant = Plant(model)
        self._system = plant.program.first_order_hold
        self._eq, made = self._system.equations, self._system.attempt
        usual = _without_force(model)[: len(names)]
        begin = [float(each) for each in (*commands, *usual[len(commands) :])]
        settled = plant.settle(begin[0], regulator_voltage=[*begin, 0.0][1])
        self.zero = settled.zero_contraction
        known = dict(zip(plant.states, settled.state.tolist(), strict=True))
        known |= dict(zip(COMMANDS, begin, strict=False))
        entries = [*self._eq.states, *self._eq.rate_independent_states]
        self.states = [Variable(e.name, _unit(e.name), known.get(e.name, 0.0)) for e in entries]
        self.command = [entry.name for entry in entries].index(COMMANDS[0])
        self.commands = [
            Variable(name, SIGNALS[name].unit, value)
            for name, value in zip(names, begin, strict=True)
        ]
        truth = [Variable(f"true.{signal.name}", signal.unit) for signal in plant.signals]
        self.readings = [Variable(s.name, s.unit) for s in plant.signals] + truth
        self._first = first_size(made.size, self._eq.graph.input("jump", CHANGING))
        live = live_inputs([*self._attempt().values(), *self._read().values()])
        used = [value for value in live if value.level == FIXED and value is not made.tolerance]
        self._inputs = [made.tolerance, *used]
        units = {f"{row.effect}.{row.parameter}": row.unit for row in model.rows()}
        self.parameters = [
            Variable(
                value.data,
                units.get(value.data.partition("[")[0], "1"),
                float(plant.vector[plant.program.offsets[value.data]]),
            )
            for value in self._inputs
        ]

    def files(self) -> dict[str, str]:
        """The texts of header and source by file name."""
        made = self._system.attempt
        graph = self._eq.graph
        inputs = {value.id: f"p[{i}]" for i, value in enumerate(self._inputs)}
        inputs |= {value.id: f"x[{i}]" for i, value in enumerate(made.before)}
        inputs |= {made.size.id: "plant->size", made.left.id: "plant->left"}
        inputs[self._eq[ZERO].id] = "plant->zero_contraction"
        inputs[graph.input("jump", CHANGING).id] = "jump"
        for i, name in enumerate(COMMANDS):
            slope = f"slope[{i}]" if i < len(self.commands) else "0.0"
            inputs[graph.input(f"{name}_slope", HELD).id] = slope
        common = {"name": self.name, "command": str(self.command)}
        header = template("plant.h").substitute(
            common,
            title=comment(self.model.title),
            model=comment(self.model.name),
            **{
                kind: "\n".join(self._enumerators(kind))
                for kind in ("parameters", "states", "commands", "readings")
            },
        )
        source = template("plant.c").substitute(
            common,
            preamble=C_PREAMBLE,
            parameters=", ".join(repr(each.value) for each in self.parameters),
            states=", ".join(repr(each.value) for each in self.states),
            zero=repr(self.zero),
            size=repr(FIRST_S),
            attempt=c_text(self._attempt(), inputs),
            first_size=c_text({"plant->size": self._first}, inputs),
            read=c_text(self._read(), inputs),
        )
        return {f"{self.name}.h": header, f"{self.name}.c": source}

    def main(self) -> str:
        """The text of a small program that runs the plant from standard input."""
        return template("main.c").substitute(name=self.name)

    def _attempt(self) -> dict[str, Value]:
        """What an attempt at a step changes, by its place."""
        made = self._system.attempt
        states = {f"x[{i}]": value for i, value in enumerate(made.states)}
        return states | {"plant->size": made.next_size, "plant->left": made.next_left}

    def _read(self) -> dict[str, Value]:
        """Readings by their place: sensors' lags or, without one, true values; true values."""
        eq = self._eq
        both = [*(eq.readings[name] for name in eq.outputs), *eq.outputs.values()]
        values = substitute(both, step_start_values(eq))
        return {f"reading[{i}]": value for i, value in enumerate(values)}

    def _enumerators(self, kind: str) -> Iterator[str]:
        for each in getattr(self, kind):
            unit = f" /* {si_unit(each.unit)} */" if each.unit else ""
            yield f"    {self.name}_{kind[:-1]}_{each.identifier},{unit}"


def template(name: str) -> Template:
    """A C text with places for names and statements."""
    folder = resources.files(__name__.rpartition(".")[0]) / "templates"
    return Template((folder / name).read_text("utf-8"))


def _without_force(model: Model) -> tuple[float, float]:
    """Commands (V, or the SI unit of the drive's command) at which the drive gives no force."""
    two_way = model.parameters.get("two_way_drive")
    return (two_way.middle if two_way else 0.0), 0.0


def _unit(state: str) -> str:
    """Unit of a state that is a signal, or the lag of one's sensor."""
    lags = {f"lag_{signal.sensor}": signal for signal in SIGNALS.values() if signal.is_measured}
    signal = SIGNALS.get(state) or lags.get(state)
    return signal.unit if signal else ""
