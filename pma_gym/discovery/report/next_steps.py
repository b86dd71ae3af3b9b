"""What to do after a diagnosis, verdict by verdict."""

from pma_gym.discovery.diagnosis import Diagnosis
from pma_gym.discovery.report.effect_text import effect_names
from pma_gym.discovery.report.figure_text import duration, figure, listed, signal_name
from pma_gym.discovery.result.noise import Nuisance
from pma_gym.effects.residual_law import FREE_LAW


def what_to_do(diagnosis: Diagnosis) -> list[str]:
    """The next things to do, the first first."""
    steps = {
        "effect": _use_effect,
        "parameters": _use_parameters,
        "agrees": _use_as_is,
        "unknown": _describe,
        "undecidable": _measure,
    }[diagnosis.verdict](diagnosis)
    if diagnosis.given.rig.is_free:
        steps += filter(None, map(_fix, diagnosis.nuisances))
    if diagnosis.next_experiment and diagnosis.verdict != "undecidable":
        steps.append(_run_next(diagnosis))
    return steps


def _fix(nuisance: Nuisance) -> str:
    """What to do about a nuisance; nothing where it harms none."""
    where = listed([f"`{column}`" for column in nuisance.signals])
    if nuisance.kind == "clock":
        (share,) = set(nuisance.signals.values())
        return (
            f"Log the commands and {where} by one clock, or divide the times of {where} by "
            f"{1.0 + share:.7g}: a simulation of these logs drifts away from them."
        )
    if nuisance.kind == "coloured noise":
        return ""
    return (
        f"Shield the sensor of {where}, or filter {figure(nuisance.hertz or 0.0)} Hz: this answer "
        "is without the hum, your logs are not."
    )


def _use_effect(diagnosis: Diagnosis) -> list[str]:
    steps = ["Use the amended model, `model.toml` beside this page"]
    rig = diagnosis.model.rig
    if rig.balances_loads:
        steps[0] += ': `gym.make("pma_gym/IsokineticDisplacement-v0", model="model.toml")`.'
    elif rig.is_free:
        steps[0] += (
            ': `RigEnv(model="model.toml")`; `python -m benchmarks from-logs LOGS` tunes for it.'
        )
    else:
        steps[0] += ': `Plant(load_model("model.toml")).simulate(trial)`.'
    for effect in diagnosis.effects:
        if effect.confused_with:
            rivals = effect_names(effect.confused_with, "or")
            steps.append(
                f"Do not yet rely on its name: {rivals} would explain these data as well. The "
                "amended model predicts trials like these either way."
            )
    return steps


def _use_parameters(diagnosis: Diagnosis) -> list[str]:
    moved = [path for path, each in diagnosis.parameters.items() if each.significant]
    named = listed([f"`{path}`" for path in moved[:3]])
    steps = ["Use the refitted model, `model.toml` beside this page; no new effect is needed."]
    if moved:
        steps.append(f"Check on the rig why {named} differ{'s' if len(moved) == 1 else ''}.")
    return steps


def _use_as_is(diagnosis: Diagnosis) -> list[str]:
    steps = [f"Keep the model {diagnosis.given.name}: nothing in these trials speaks against it."]
    if diagnosis.not_detectable:
        steps.append(
            "These trials cannot show "
            f"{effect_names(diagnosis.not_detectable, 'or')}; if one of them matters to you, "
            "measure what excites it."
        )
    return steps


def _describe(diagnosis: Diagnosis) -> list[str]:
    steps = ["Look at the law below: any explanation must have its shape."] * bool(diagnosis.law)
    steps += [
        f"Look for what oscillates at {figure(hertz)} Hz and reaches the {signal_name(signal)}: a "
        "loose frame, a hose, a supply, the mains beyond half the sampling rate."
        for signal, hertz in diagnosis.tones.items()
    ]
    if diagnosis.law is None:
        return [
            *steps,
            "Log at rest, repeat a trial, check the clock and look for play: what changes tells "
            "where it comes from.",
        ]
    drafted = (
        "Diagnose again with `--effect` and `proposed_effect.py` beside this page, which has it as "
        "a user effect; then make its law what you think acts."
    )
    write = (
        "Write it as a user effect, one Python file, and diagnose again with `--effect FILE.py`."
    )
    if any(effect.replaces == FREE_LAW for effect in diagnosis.model.effects.values()):
        steps.append(
            "Use the amended model, `model.toml` beside this page, until you know what acts: it "
            "has that law, value by value."
        )
    return [*steps, drafted if diagnosis.draft else write]


def _measure(diagnosis: Diagnosis) -> list[str]:
    if diagnosis.next_experiment is None:
        rig = diagnosis.given.rig
        more = "loads and pressures" if rig.has_muscle else "positions and forces"
        return [f"Measure trials that move the {rig.name} further: more speeds, {more}."]
    return [
        _run_next(diagnosis),
        "Keep the given model until then: `model.toml` only has refitted parameters.",
    ]


def _run_next(diagnosis: Diagnosis) -> str:
    following = diagnosis.next_experiment
    assert following is not None
    excitation = following.excitation[:1].lower() + following.excitation[1:]
    run = (
        f"`next.csv` on the rig ({excitation}; {duration(following.minutes)}), save its log into "
        "the data set under a new name, and diagnose again."
    )
    if diagnosis.verdict in ("parameters", "agrees"):
        shown = effect_names(following.separates, "or")
        return f"These trials cannot show {shown}. To rule that out, run {run}"
    return f"Run {run}"
