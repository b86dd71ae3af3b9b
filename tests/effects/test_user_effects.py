"""Effects of one's own: a file named by its user, checked, added, simulated."""

import copy
import inspect
import json
import os
import pickle
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from benchmarks.executors.executor import run_or_raise
from benchmarks.executors.local import LocalProcesses
from pma_gym.codegen.trace import live_inputs
from pma_gym.data.trial import Trial
from pma_gym.discovery.fitting.journal import digest
from pma_gym.discovery.screening.candidates import candidate_effects
from pma_gym.effects import CATALOGUE, Effect, user_effects
from pma_gym.effects.ports import measured_output
from pma_gym.effects.rig_ports import OPEN_PORTS, RATE_SIGNALS
from pma_gym.effects.user_effects import OwnEffectError, load_effects, source_of
from pma_gym.envs import PMAEnv
from pma_gym.integrator.equations import COMMANDS, ZERO
from pma_gym.plant.composition import PlantEquations
from pma_gym.plant.model import ModelError, dump_model, load_model
from pma_gym.plant.plant import Plant
from pma_gym.plant.program import structure
from pma_gym.plant.statics import muscle_force
from tests.plant.test_joint import joint
from tests.plant.test_rigs import FIRST, MODELS

HEAD = """
from typing import Annotated, NamedTuple
from pma_gym.effects import Effect
from pma_gym.effects.arithmetic import where
from pma_gym.units import Quantity
"""
DRAG = (
    HEAD
    + '''
class Drag(NamedTuple):
    """Parameters of `drag`."""

    factor: Annotated[
        float, Quantity("N s^2/mm^2", 0, 1, "assumption: 0.02", 0.0, usual=0.02)
    ]

def drag(velocity, p):
    """Force as the square of speed."""
    return -p.factor * velocity * abs(velocity)

DRAG = Effect("drag", "slide_force", Drag, drag, signature="force as the square of speed")
'''
)


pytestmark = pytest.mark.usefixtures("forget_user_effects")


@pytest.fixture
def write(tmp_path):
    def written(text, name="mine.py"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return written


def way(plant):
    """Extension while the motor jumps, without noise."""
    time = np.linspace(0.0, 0.5, 251)
    commands = {
        "motor_voltage": np.where(time > 0.0, 4.0, 2.0),
        "regulator_voltage": np.full(len(time), plant.regulator_voltage(300e3)),
    }
    logged = plant.simulate(Trial(time=time, commands=commands, measurements={}), noise=False)
    return logged.truth["extension"]


def test_an_effect_of_ones_own_is_simulated(write, station):
    (drag,) = load_effects(write(DRAG))
    assert isinstance(drag, Effect) and CATALOGUE["drag"] is drag
    assert "velocity * abs(velocity)" in inspect.getsource(drag.law)
    model = station.model.with_effects({"drag": {"factor_n_s2_per_mm2": 0.02}})
    slow, plain = way(Plant(model)), way(station)
    assert (plain - slow).max() > 1e-3
    assert slow[-1] == pytest.approx(plain[-1], abs=2e-5)
    absent = Plant(station.model.with_effects(["drag"]))
    np.testing.assert_array_equal(way(absent), plain)


def test_the_example_of_the_documentation_works(write):
    page = Path(__file__).parents[2] / "docs" / "user-effects.md"
    (example,) = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    (drag,) = load_effects(write(example))
    assert drag.name == "drag" and drag.usual.factor == pytest.approx(2e4)


@pytest.mark.parametrize(
    "law",
    [
        "velocity**3",
        "velocity * abs(velocity) ** (2 / 3)",
        "np.tanh(1e3 * velocity) * np.exp(-np.square(velocity))",
        "np.sign(velocity) * np.log(1.0 + np.sqrt(np.abs(velocity)))",
        "interp2d(velocity, pressure, (-1.0, 1.0), (0.0, 3e5), ((-1.0, 1.0), (-2.0, 2.0)))",
    ],
)
def test_a_law_in_numpys_words_slows_a_station(law, write, station):
    text = broken("velocity * abs(velocity)", law).replace(
        "drag(velocity", "drag(pressure, velocity"
    )
    load_effects(write(f"import numpy as np\n{text}".replace("import where", "import interp2d")))
    plain, neutral = way(station), way(Plant(station.model.with_effects(["drag"])))
    np.testing.assert_allclose(neutral, plain, rtol=1e-12)
    slow = way(Plant(station.model.with_effects({"drag": {"factor_n_s2_per_mm2": 1e-4}})))
    assert 1e-6 < (plain - slow).max() < 1e-2


def test_loading_a_file_again_changes_nothing(write):
    path = write(DRAG)
    first, second = load_effects(path), load_effects(str(path))
    assert [a is b for a, b in zip(first, second, strict=True)] == [True]


def test_a_changed_file_is_compiled_anew(write, station):
    made = []
    for text in (DRAG, STRONGER):
        load_effects(write(text))
        model = station.model.with_effects(DRAGGED)
        made.append((structure(model), way(Plant(model))))
    (before, slow), (after, slower) = made
    assert before != after
    assert (slow - slower).max() > 1e-3
    assert source_of("hysteresis") == ""


def test_numbers_from_elsewhere_are_part_of_the_key(write, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "mine_constants.py").write_text("SHARE = 0.5\n")
    text = DRAG.replace("-p.factor", "-SHARE * p.factor") + "\n"
    path = write("from mine_constants import SHARE\n" + text)
    load_effects(path)
    first = source_of("drag")
    del CATALOGUE["drag"], user_effects._sources["drag"]
    import mine_constants

    monkeypatch.setattr(mine_constants, "SHARE", 0.7)
    load_effects(path)
    assert source_of("drag") != first


def test_a_force_of_the_muscle_that_depends_on_speed_has_a_static_force(write, station):
    load_effects(write(DRAG.replace("slide_force", "muscle_force")))
    model = station.model.with_effects({"drag": {"factor_n_s2_per_mm2": 0.02}})
    at = np.array([300e3]), np.array([0.03])
    assert muscle_force(model)(*at) == muscle_force(station.model)(*at)
    Plant(model).settle(2.0, 300e3)


def broken(old, new):
    assert old in DRAG
    return DRAG.replace(old, new)


NEUTRAL = '"assumption: 0.02", 0.0, usual=0.02'
BROKEN = {
    "text": ("def drag(:", r"cannot be run: SyntaxError.*line 1"),
    "name": ("x = 1 / 0", r"cannot be run: ZeroDivisionError: division by zero \(line 1\)"),
    "exit": ("raise SystemExit(3)", r"cannot be run: SystemExit"),
    "nothing": (HEAD, r"defines no effect; write NAME = Effect"),
    "taken": (broken('"drag"', '"creep"'), r"\[creep\] has a name that the catalogue has already"),
    "word": (broken('"drag"', '"my drag"'), r"needs a name of letters, digits and _"),
    "port": (
        broken("slide_force", "muscle"),
        r"acts at port 'muscle'; effects .* ports of a station: mus",
    ),
    "replaced": (
        broken("slide_force", "cable"),
        r"acts at port 'cable'; effects can be added at .* of a joint: drive",
    ),
    "signal": (
        broken("drag(velocity, p)", "drag(velocity, load, p)"),
        r"cannot know load; at port",
    ),
    "memory": (broken("drag(velocity, p)", "drag(memory, velocity, p)"), r"cannot know memory"),
    "neutral": (broken(NEUTRAL, NEUTRAL.replace(" 0.0,", " None,")), r"is never absent"),
    "usual": (broken(", usual=0.02", ""), r"gives no usual value to factor"),
    "same": (broken("usual=0.02", "usual=0"), r"is absent at its usual values"),
    "held": (
        broken("drag, sig", 'drag, held=("width",), sig'),
        r"holds width, which are none of fac",
    ),
    "plain": (broken("factor: Annotated", "factor: float\n    other: Annotated"), r"no NamedTuple"),
    "branch": (broken("return -", "return 0.0 if velocity > 0.0 else -"), r"cannot be compiled"),
    "math": (
        broken("abs(velocity)", "__import__('math').sin(velocity)"),
        r"np.tanh\(x\), not math's; use ",
    ),
    "negative": (
        broken("abs(velocity)", "velocity ** (2 / 3)"),
        r"gives nan at velocity -0.05 \(SI\), .*; take powers and logarithms of abs\(x\)",
    ),
    "default": (
        broken("usual=0.02)\n    ]", "usual=0.02)\n    ] = 3.0"),
        r"gives factor a default of 3.0 \(SI\) and another usual value, 0.02 N s\^2/mm\^2",
    ),
    "there": (broken("return -", "return 5.0 - "), r"gives 5 at velocity 0.1 \(SI\), and 0 would"),
    "lawless": (broken("Drag, drag, sig", "Drag, sig"), r"has no law; give law="),
    "twice": (DRAG + "\nMORE = Effect('drag', 'slide_force', Drag, drag)\n", r"is there twice"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_cannot_be_used_is_refused_with_its_mend(name, write):
    text, message = BROKEN[name]
    path, before = write(text), dict(CATALOGUE)
    with pytest.raises(OwnEffectError, match=message) as raised:
        load_effects(path)
    assert str(path) in str(raised.value)
    assert before == CATALOGUE


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("nothing.py", None, r"cannot be read .*; name a Python file"),
        ("notes.txt", "x = 1", r"its name must end in .py"),
        (f"my{os.pathsep}effects.py", None, r"in its path, which separates .*; rename it"),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path, name, content, message):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(OwnEffectError, match=message):
        load_effects(tmp_path / name)


def test_two_files_cannot_have_one_name(write):
    load_effects(write(DRAG))
    with pytest.raises(OwnEffectError, match=r"has a name that .*mine.py has already; choose"):
        load_effects(write(DRAG, "other.py"))


MEMORY = (
    HEAD
    + """
class Branch(NamedTuple):
    size: Annotated[float, Quantity("1", 0, 10, "assumption: 1", 0.0, usual=1)]

def law({signals}memory, p):
    return {absent} + p.size * memory

def rate({everything}, memory, p):
    return 1e-9 * ({sum}), 1.0 + 0.0 * memory

BRANCH = Effect("branch", "{port}", Branch, law, rate=rate)
"""
)


PLACES = [(rig, port) for rig, ports in OPEN_PORTS.items() for port in ports]
# The first muscle of a pair is that of a joint with one.
PLACES = [(r, p) for r, p in PLACES if r != "muscle_pair" or p not in OPEN_PORTS["muscle_joint"]]


@pytest.mark.parametrize(("rig", "port"), PLACES)
def test_laws_may_know_what_the_table_says(rig, port, write):
    """Every signal at every port is one that the rig has when it gets there."""
    place, bare = OPEN_PORTS[rig][port], load_model(MODELS[rig])
    assert port in bare.rig.ports or measured_output(port) in bare.rig.outputs
    known = {
        "signals": "".join(f"{name}, " for name in place.signals),
        "absent": place.absent if isinstance(place.absent, str) else f"{place.absent!r}",
        "everything": ", ".join(RATE_SIGNALS[rig]),
        "sum": " + ".join(RATE_SIGNALS[rig]),
        "port": port,
    }
    if isinstance(place.absent, float):
        used = " + ".join(f"0.0 * {name}" for name in place.signals)
        known["absent"] = f"{place.absent!r} + ({used})"
    (effect,) = load_effects(write(MEMORY.format(**known)))
    model = bare.with_effects({"branch": {}})
    equations = PlantEquations(model.effects, model.parameters)
    model.rig.write_equations(equations)
    states = {entry.name for entry in equations.remembered}
    inputs = live_inputs([state.rate for state in equations.states])
    inner = {"origin", "direction"}
    plain = {v.data for v in inputs if "." not in v.data}
    assert plain <= states | set(COMMANDS) | inner | {ZERO}
    has_sensor = any(e.port == port and not e.law for e in model.effects.values())
    if not measured_output(port) or has_sensor:
        assert set(effect.memory_names) <= states
    measured = Plant(model).simulate(FIRST[rig], noise=False).measurements
    assert all(np.isfinite(values).all() for values in measured.values())


def test_an_effect_with_a_memory_settles_and_runs(write, station):
    text = DRAG.replace("def drag(velocity, p):", "def drag(memory, p):").replace(
        "return -p.factor * velocity * abs(velocity)", "return -memory"
    )
    text = text.replace("drag, sig", "drag, rate=rate, sig").replace(
        "DRAG =",
        "def rate(velocity, p):\n    return 1e-3 * p.factor * velocity, 1.0 + 0.0 * velocity\n\n"
        "DRAG =",
    )
    load_effects(write(text))
    model = station.model.with_effects({"drag": {"factor_n_s2_per_mm2": 1.0}})
    plant = Plant(model)
    assert "memory_drag" in plant.states
    assert (way(station) - way(plant)).max() > 1e-4


DRAGGED = {"drag": {"factor_n_s2_per_mm2": 0.02}}
STRONGER = DRAG.replace("-p.factor *", "-3.0 * p.factor *")


@pytest.fixture
def dragged(write, tmp_path, station):
    """A model with a user effect, saved beside its file, and pickled environments of it."""
    load_effects(write(DRAG))
    model = station.model.with_effects(DRAGGED, name="dragged")
    (tmp_path / "model.toml").write_text(dump_model(model))
    return model


def test_a_saved_model_names_the_file_and_the_law_of_its_user_effects(dragged, write, tmp_path):
    saved = (tmp_path / "model.toml").read_text()
    assert load_model(tmp_path / "model.toml").parameters["drag"] == dragged.parameters["drag"]
    assert '\neffects_from = ["mine.py"]  # sha256 ' in saved
    load_effects(write(STRONGER))
    assert dump_model(dragged).partition("sha256")[0] == saved.partition("sha256")[0]
    assert dump_model(dragged) != saved
    assert "effects_from" not in dump_model(load_model("station"))


def test_what_a_diagnosis_keeps_depends_on_the_law_of_every_user_effect(write, station):
    load_effects(write(DRAG))
    before = digest((), station.model, "")
    load_effects(write(STRONGER))
    assert digest((), station.model, "") != before


def test_a_model_runs_no_file_but_says_how_to(dragged, tmp_path, forget_user_effects):
    forget_user_effects()
    path, own = tmp_path / "model.toml", tmp_path / "mine.py"
    with pytest.raises(ModelError) as raised:
        load_model(path)
    for part in (f"{path}: unknown effect [drag]", f"--effect {own}", f'load_effects("{own}")'):
        assert part in str(raised.value)
    assert f"PMA_GYM_EFFECTS={own}" in str(raised.value)


@pytest.mark.parametrize("names", ["mine.py", [3]])
def test_a_model_names_files_in_a_list(dragged, tmp_path, names):
    text = (tmp_path / "model.toml").read_text()
    start, _, rest = text.partition("effects_from = ")
    rest = f"{json.dumps(names)}\n{rest.partition(chr(10))[2]}"
    (tmp_path / "model.toml").write_text(f"{start}effects_from = {rest}")
    with pytest.raises(ModelError, match=r"effects_from must be a list of .*got"):
        load_model(tmp_path / "model.toml")


def test_a_pickle_runs_no_file_but_takes_those_that_are_named(dragged, tmp_path):
    """Environment, plant and model of a user effect, in processes that have loaded no file."""
    kept = tmp_path / "kept.pickle"
    env = PMAEnv("displacement", model=dragged, pressure_kpa=300.0)
    env.reset(seed=1)
    kept.write_bytes(pickle.dumps((env, Plant(dragged), dragged)))
    after = env.step(np.zeros(env.action_space.shape, np.float32))[0]
    program = (
        "import pickle, sys, numpy as np; env, plant, model = pickle.load(open(sys.argv[1], 'rb'));"
        "print(*map(float, env.step(np.zeros(env.action_space.shape, np.float32))[0]))"
    )

    def fresh():
        return subprocess.run(
            [sys.executable, "-c", program, kept], capture_output=True, text=True, cwd="/"
        )

    assert os.environ["PMA_GYM_EFFECTS"] == str(tmp_path / "mine.py")
    done = fresh()
    assert done.stdout.split() == [str(float(one)) for one in after], done.stderr
    del os.environ["PMA_GYM_EFFECTS"]
    said = fresh().stderr.splitlines()[-1]
    assert "pickled model dragged: unknown effect [drag]; the model says" in said
    assert "from mine.py" in said and "--effect mine.py" in said


def test_workers_know_the_effects_of_their_parent(dragged):
    models = {}
    run_or_raise([partial(copy.copy, dragged)] * 2, LocalProcesses(2), models.__setitem__)
    assert [dump_model(models[i]) for i in (0, 1)] == [dump_model(dragged)] * 2


def test_the_variable_names_files_of_which_one_may_be_wrong(write, monkeypatch):
    monkeypatch.setenv("PMA_GYM_EFFECTS", os.pathsep.join(["", str(write(DRAG)), "gone.py"]))
    for _ in range(2):
        with pytest.raises(OwnEffectError, match=r"^PMA_GYM_EFFECTS names .*gone.py: cannot be"):
            load_model("station")
    assert "drag" in CATALOGUE


AXIS = (
    HEAD
    + """
import numpy as np

class Size(NamedTuple):
    size: Annotated[float, Quantity("{unit}", 0, 100, "assumption", 0.0, usual={usual})]

def law({signals}, p):
    return {law}

OWN = Effect("own", "{port}", Size, law, signature="own")
"""
)
TIME = np.linspace(0.0, 1.0, 201)
WAVE = np.sin(5.0 * TIME + 8.0 * TIME**2)
DRIVEN = {
    "slide": (MODELS["slide"], {"load_command": 20.0 * WAVE}),
    "joint": (
        joint(True, encoder={"bandwidth_hz": 1000.0, "noise_deg": 0.01}),
        {"torque_command": 0.1 * WAVE},
    ),
}
"""A model of a rig with a sensor, and commands that move it."""


@pytest.mark.parametrize(
    ("rig", "port", "unit", "usual", "signals", "law"),
    [
        ("slide", "slide_force", "N", 4.0, "velocity", "-p.size * np.tanh(velocity / 0.01)"),
        ("slide", "contact_force", "N", 9.0, "velocity", "-p.size * np.sin(velocity)"),
        ("slide", "muscle_damping", "N s/mm", 0.2, "velocity", "p.size * abs(velocity) ** (2 / 3)"),
        ("slide", "drive_gain", "1", 0.1, "drive_force", "p.size * drive_force"),
        (
            *("slide", "drive_loss", "1", 0.1, "drive_force, velocity"),
            "-p.size * np.abs(drive_force) * np.tanh(velocity / 0.01)",
        ),
        (
            *("slide", "drive_lag", "1", 0.2, "load_command"),
            "load_command * (1.0 - p.size * np.tanh(load_command / 10.0) ** 2)",
        ),
        ("joint", "joint_torque", "N m", 0.02, "spin", "-p.size * np.tanh(spin / 0.05)"),
        ("joint", "joint_load", "N m", 0.2, "position", "-p.size * position**3"),
        ("joint", "drive_gain", "1", 0.1, "drive_force", "p.size * drive_force**3 * 50.0"),
        (
            *("joint", "joint_drive_loss", "1", 0.1, "drive_force, carried_force, spin"),
            "-p.size * np.sqrt(drive_force**2 + 1e-6) * np.tanh(spin / 0.05)",
        ),
        ("joint", "drive_lag", "1", 0.2, "load_command", "load_command * (1.0 - p.size)"),
    ],
)
def test_the_size_of_a_law_on_an_axis_is_fitted(rig, port, unit, usual, signals, law, write):
    """Friction, springs and drives of a user on slides and joints: simulated, then found again."""
    text = AXIS.format(unit=unit, usual=usual, signals=signals, law=law, port=port)
    (effect,) = load_effects(write(text))
    bare, commands = load_model(DRIVEN[rig][0]), DRIVEN[rig][1]
    (path,) = [f"own.{name}" for name in effect.names_in_files()]
    truth = bare.with_effects({"own": {path[4:]: usual}})
    trial = Plant(truth).simulate(Trial(TIME, commands), seed=1)

    def off(size):
        exact = Plant(truth.replace({path: float(size[0])})).simulate(trial, noise=False)
        rows = trial.measurements.items()
        return np.concatenate(
            [(exact.measurements[name] - row) / np.std(row) for name, row in rows]
        )

    (size,) = least_squares(off, [1.5 * usual], x_scale=usual, diff_step=1e-3).x
    assert size == pytest.approx(usual, rel=0.05)
    assert "own" in {each.effect for each in candidate_effects(bare)}


def test_a_law_is_refused_on_a_rig_without_its_signals(write, station):
    load_effects(write(DRAG.replace("drag(velocity", "drag(contraction, velocity")))
    station.model.with_effects(["drag"])
    with pytest.raises(ModelError, match=r"cannot know contraction; at port slide_force of a sl"):
        load_model(MODELS["slide"]).with_effects(["drag"])


def test_a_bound_comes_back_from_si_as_itself():
    for effect in CATALOGUE.values():
        for quantity in effect.quantities.values():
            for end in (quantity.lower, quantity.upper):
                assert quantity.from_si(quantity.to_si(end)) == end
