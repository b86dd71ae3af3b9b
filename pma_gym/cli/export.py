"""`pma-gym export`: a model for other programs."""

from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from pma_gym.cli.terminal import model_names, print_table, say, warnings_said
from pma_gym.files import check_output, replace_files
from pma_gym.pages.document import TextTable
from pma_gym.plant.model import Model, load_model
from pma_gym.units import parse_numbers


class Target(StrEnum):
    """What a model is exported to."""

    C = "c"
    FMU = "fmu"
    MJCF = "mjcf"


def export(
    model: Annotated[
        str, typer.Argument(help="Shipped name or TOML file.", autocompletion=model_names)
    ],
    to: Annotated[
        Target, typer.Option(help="C99, an FMU, or MuJoCo (slides and joints).")
    ] = Target.C,
    out: Annotated[Path, typer.Option(help="Folder of what is written.")] = Path("."),
    start: Annotated[
        str,
        typer.Option(
            help="Commands that C and FMU start settled at, as 2,5 (V; N m); no force if not given."
        ),
    ] = "",
    fmi: Annotated[int, typer.Option(min=2, max=3, help="Version of FMI.")] = 3,
    logs: Annotated[
        Path | None,
        typer.Option(help="Folder of logs: replay them in MuJoCo and print the difference."),
    ] = None,
    trials: Annotated[
        Path | None, typer.Option(help="trials.toml of a diagnosis or a fit: starts of the logs.")
    ] = None,
) -> None:
    """Write a model's plant as C99, as an FMU or as a MuJoCo model."""
    # Imported here: other commands do without.
    from pma_gym.export.c_plant import CPlant, ExportError, identifier

    if logs and to is not Target.MJCF:
        raise ExportError(f"--logs are replayed in MuJoCo: give --to mjcf, got --to {to}")
    exported = load_model(model)
    if to is Target.MJCF:
        from pma_gym.export.mjcf import mjcf

        contents = {f"{identifier(exported.name)}.xml": mjcf(exported).encode()}
    else:
        commands = parse_numbers(start)
        if commands is None:
            raise ExportError(f"--start must be numbers such as 2,5, got {start!r}")
        plant = CPlant(exported, commands)
        if to is Target.C:
            texts = {**plant.files(), f"{plant.name}_main.c": plant.main()}
            contents = {name: text.encode() for name, text in texts.items()}
        else:
            from pma_gym.export.fmu import fmu_bytes

            contents = {f"{plant.name}.fmu": fmu_bytes(plant, fmi)}
    for name in contents:
        check_output(out / name)
    replace_files({out / name: content for name, content in contents.items()})
    print("\n".join(str(out / name) for name in contents))
    if to is Target.MJCF:
        _say_lost(exported)
    if logs:
        _print_replay(exported, logs, trials)


def _say_lost(model: Model) -> None:
    from pma_gym.export.mjcf import lost_effects

    for lost in lost_effects(model):
        say(f"MuJoCo has no word for {lost.effect}: it lacks {lost.reason}")


def _print_replay(model: Model, logs: Path, trials: Path | None) -> None:
    """Print how far MuJoCo is from the model's own simulation under the commands of logs."""
    from pma_gym.data.datasets.dataset import read_dataset
    from pma_gym.discovery.fitting.trial_states import read_states
    from pma_gym.export.c_plant import si_unit
    from pma_gym.export.mjcf import replay

    with warnings_said():
        data = read_dataset(logs)
    states = read_states(trials) if trials else {}
    own = [states[each.name].parameters if each.name in states else {} for each in data.trials]
    runs = [(model.replace(dict(o)), each.trial) for o, each in zip(own, data.trials, strict=True)]
    rows = [[name, *_figures(sizes)] for name, sizes in replay(runs).items()]
    title = "Difference from the model, in standard deviations of the sensors (rms)"
    header = [
        each.name if each.sensor in model.parameters else f"{each.name} ({si_unit(each.unit)})"
        for each in model.rig.signals
    ]
    print_table(TextTable(title, ("compared", *header), rows))


def _figures(sizes: Iterable[float]) -> list[str]:
    return [f"{size:.3g}" for size in sizes]
