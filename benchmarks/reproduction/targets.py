"""Targets of the job: each beside the figure of this run."""

from collections.abc import Iterable
from dataclasses import dataclass

from benchmarks.reproduction.replay import replay_errors, summarise
from benchmarks.reproduction.results import Results
from benchmarks.runner.controller_spec import ControllerSpec
from pma_gym.pages.document import TextTable

_SIMPLE = {"slope": "mm/s", "intercept": "mm", "rmse": "mm"}
_NAMES = {"slope": "slope", "intercept": "intercept", "rmse": "RMSE"}


@dataclass(frozen=True)
class Check:
    """A target and what was got.

    Attributes:
        what: what was measured.
        limit: largest value that meets the target.
        got: the figure; None if it was not run, or failed.
        unit: of both.
        strict: whether the figure must lie below the limit, not at it.
    """

    what: str
    limit: float
    got: float | None
    unit: str
    strict: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None if the figure is missing."""
        if self.got is None:
            return None
        return self.got < self.limit if self.strict else self.got <= self.limit

    @property
    def verdict(self) -> str:
        """`met`, `missed` or `no figure`."""
        return {True: "met", False: "missed", None: "no figure"}[self.met]

    def document(self) -> dict[str, object]:
        """The target for programs."""
        return {
            "target": self.what,
            "limit": self.limit,
            "got": self.got,
            "unit": self.unit,
            "verdict": self.verdict,
        }


def check_targets(results: Results) -> list[Check]:
    """Every target of the suite, on its first model."""
    goals = results.suite.goals
    wall = results.info.get("wall_time_s")
    # A run that went on took only a part of the time.
    whole = not (results.failures or results.suite.selected or results.info.get("cases_reused"))
    return [
        *_replay_checks(results),
        *(
            check
            for controller in results.suite.controllers
            # Somebody's own controller is held to what feedback is to reach.
            if controller.name in goals.feedback or controller.path
            for check in _feedback_checks(results, controller)
        ),
        Check("whole job", goals.wall_time_s, wall if whole else None, "s", strict=True),
    ]


def target_table(checks: Iterable[Check], model: str) -> TextTable:
    """Targets, what was got on a model, met or missed."""
    rows = [
        [
            check.what,
            f"{'<' if check.strict else '≤'} {check.limit:g} {check.unit}",
            "—" if check.got is None else f"{check.got:.3g} {check.unit}",
            check.verdict,
        ]
        for check in checks
    ]
    return TextTable(
        f"What the suite asks for, on {model}", ["What", "Target", "This run", "Verdict"], rows
    )


def _replay_checks(results: Results) -> list[Check]:
    suite = results.suite
    errors = replay_errors(results, suite.models[0], "displacement", "displacement")
    if not any(controller.name == suite.goals.replay for controller in suite.controllers):
        return []
    pressures = suite.pressures_kpa.get("displacement", ())
    whole = not suite.selected and len(errors) == len(pressures)
    got = summarise(errors).absolute if errors and whole else {}
    return [
        Check(
            f"replay, displacement: mean absolute error of {_NAMES[name]}",
            suite.goals.simple_prediction[name],
            got.get(name),
            unit,
            strict=True,
        )
        for name, unit in _SIMPLE.items()
    ]


def _feedback_checks(results: Results, spec: ControllerSpec) -> list[Check]:
    goals = results.suite.goals
    label, controller = spec.label, spec.name
    moving = [_worst(results, controller, "rotation", phase) for phase in ("I", "II")]
    known = [value for value in moving if value is not None]
    return [
        Check(
            f"{label}: displacement, largest RMSE",
            goals.displacement_rmse_mm,
            _worst(results, controller, "displacement", "displacement"),
            "mm",
        ),
        Check(
            f"{label}: rotation I and II, largest RMSE",
            goals.rotation_moving_rmse_deg,
            max(known) if len(known) == len(moving) else None,
            "deg",
        ),
        Check(
            f"{label}: rotation III, largest RMSE above the bound",
            goals.return_above_bound_deg,
            _worst_excess(results, controller),
            "deg",
        ),
    ]


def _rmse(results: Results, controller: str, task: str, phase: str) -> list[float | None]:
    """RMSE at each of the task's pressures on the first model; None where there is none."""
    scores = (
        results.phase(results.suite.models[0], controller, task, pressure, phase)
        for pressure in results.suite.pressures_kpa.get(task, ())
    )
    return [score.rmse if score else None for score in scores]


def _worst(results: Results, controller: str, task: str, phase: str) -> float | None:
    return _largest(_rmse(results, controller, task, phase))


def _worst_excess(results: Results, controller: str) -> float | None:
    pressures = results.suite.pressures_kpa.get("rotation", ())
    bounds = [results.bounds.get(pressure) for pressure in pressures]
    pairs = zip(_rmse(results, controller, "rotation", "III"), bounds, strict=True)
    return _largest(None if got is None or b is None else got - b for got, b in pairs)


def _largest(values: Iterable[float | None]) -> float | None:
    """The largest; None if there is none, or one of them is missing."""
    known = list(values)
    numbers = [value for value in known if value is not None]
    return max(numbers) if numbers and len(numbers) == len(known) else None
