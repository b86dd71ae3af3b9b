"""The nominal model that an environment simulates, with the effects of its task and options."""

from pma_gym.effects import CATALOGUE
from pma_gym.engine.options import Options
from pma_gym.plant.model import Model
from pma_gym.tasks import Task


def rig_model(task: Task, options: Options) -> Model:
    """Return the nominal model with the effects that the options need, such as a hand push.

    Raises:
        ModelError: an unknown or invalid model.
        ValueError: a cascade for a task that needs a station.
    """
    model = options.nominal
    if not model.rig.has_muscle:
        raise ValueError(
            f"task {task.name} needs the model of a station or a cascade; model {model.name} is of "
            f'plant = "{model.plant}": make it with gym.make("pma_gym/Rig-v0", model=...)'
        )
    pushed = options.disturbing.hand_push_force != 0.0
    if not model.rig.balances_loads and (pushed or task.load or task.exercise):
        what = f"disturbances={options.disturbances!r}" if pushed else f"task {task.name}"
        held = "plays an operator" if task.exercise else "holds a load"
        why = "somebody pulls at its slide" if pushed else f"the motor {held}"
        raise ValueError(
            f"{what} needs the model of a station, where {why}; got {model.name}, a {model.plant}; "
            "take station or serres2008"
        )
    model = nominal_model(task, model)
    if not pushed or "hand_push" in model.parameters:
        return model
    return model.with_effects({"hand_push": {"share": 1.0}})


def nominal_model(task: Task, model: Model) -> Model:
    """Return the nominal model that controllers receive, in an exercise with a leg on the lever."""
    if task.exercise is None or "leg" in model.parameters or not model.rig.balances_loads:
        return model
    leg = CATALOGUE["leg"]
    usual = {
        file_key: leg.quantities[stem].usual for file_key, stem in leg.names_in_files().items()
    }
    return model.with_effects(
        {"leg": {file_key: float(value or 0.0) for file_key, value in usual.items()}}
    )


def motor_at_rest(model: Model, task: Task) -> float:
    """Motor voltage at the start of episodes (V), with which a nominal drive holds the task's load.

    Raises:
        ValueError: the drive cannot hold this load.
    """
    load = rest_load(model, task)
    if not load:
        return 0.0
    drive = model.parameters["drive"]
    volts = (load - drive.offset) / drive.gain
    if not 0.0 <= volts <= 10.0:
        raise ValueError(
            f"task {task.name}: the load must lie in {max(0.0, drive.offset):.4g} to "
            f"{10.0 * drive.gain + drive.offset:.4g} N, what the drive of model {model.name} holds "
            f"with 0-10 V; got {load:g} N"
        )
    return volts


def rest_load(model: Model, task: Task) -> float:
    """Load of the motor at the start of an episode (N), with the nominal pulley."""
    if task.exercise is None:
        return task.load
    return task.exercise.start_moment / model.parameters["rotor"].radius
