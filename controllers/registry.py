"""The controllers by name: one row for each, and a row is all that a new one needs here."""

from collections import UserDict
from collections.abc import Callable
from importlib import import_module
from typing import Any

from controllers.controller import Controller

ENTRY_POINTS = {
    "serres_replay": "controllers.serres_replay:SerresReplay",
    "serres_feedforward": "controllers.serres_feedforward:SerresFeedforward",
    "improved_feedforward": "controllers.improved_feedforward:ImprovedFeedforward",
    "pid": "controllers.pid:PID",
    "feedforward_pid": "controllers.feedforward_pid:FeedforwardPID",
    "lqg": "controllers.lqg:LQG",
    "adrc": "controllers.adrc:ADRC",
    "sliding_mode": "controllers.sliding_mode:SlidingMode",
    "mpc": "controllers.mpc:PreviewMPC",
    "ilc": "controllers.ilc:ILC",
    "ppo": "controllers.policy:PPOPolicy",
    "ppo_ilc": "controllers.policy_with_ilc:PolicyWithILC",
    "oracle": "controllers.oracle:Oracle",
    "constant_pressure": "controllers.exercise.constant_pressure:ConstantPressure",
    "scheduled_pressure": "controllers.exercise.scheduled_pressure:ScheduledPressure",
    "speed_pid": "controllers.exercise.speed_pid:SpeedPID",
    "moment_pid": "controllers.exercise.moment_pid:MomentPID",
    "exercise_mpc": "controllers.exercise.exercise_mpc:ExerciseMPC",
}
"""Name, and `module:class` of what makes a new controller, in the order of tables and reports."""


class ControllerRegistry(UserDict[str, Callable[[], Controller]]):
    """Mapping of a name to what makes a new controller of it.

    Rows name a class, as Gymnasium's entry points do. The class is imported when it is first asked
    for, so a policy's file can name the controller that its action is added to without an import
    cycle.

    >>> CONTROLLERS["pid"]().name
    'pid'
    """

    data: dict[str, Any]

    def __getitem__(self, name: str) -> Callable[[], Controller]:
        """The class of a name.

        Raises:
            KeyError: no controller of that name.
        """
        entry = self.data[name]
        if isinstance(entry, str):
            module, _, attribute = entry.partition(":")
            entry = self.data[name] = getattr(import_module(module), attribute)
        return entry


CONTROLLERS = ControllerRegistry(ENTRY_POINTS)  # type: ignore[arg-type] - rows become classes
"""Controllers by name: what makes a new one."""

RENAMED_MODULES = {
    "controllers.bank_design": "controllers.observers.filter_bank_design",
    "controllers.bounded_program": "controllers.design.quadratic_program",
    "controllers.cable": "controllers.models.cable",
    "controllers.contraction_inverse": "controllers.models.contraction_inverse",
    "controllers.damping_bank": "controllers.observers.filter_bank",
    "controllers.designs": "controllers.design.designs",
    "controllers.exercise_foresight": "controllers.exercise.joint_prediction",
    "controllers.exercise_mpc": "controllers.exercise.exercise_mpc",
    "controllers.feedforward": "controllers.improved_feedforward",
    "controllers.foresight": "controllers.models.prediction",
    "controllers.form": "controllers.policies.action_mapping",
    "controllers.gains": "controllers.design.gains",
    "controllers.horizon": "controllers.design.horizon",
    "controllers.inverse": "controllers.models.inverse",
    "controllers.joint_speed": "controllers.exercise.joint_speed",
    "controllers.kalman": "controllers.observers.deviation_filter",
    "controllers.lag_control": "controllers.observers.observer_feedback",
    "controllers.lags": "controllers.observers.extended_state_observer",
    "controllers.leg_observer": "controllers.exercise.leg_observer",
    "controllers.lifted": "controllers.models.lifted_model",
    "controllers.linear_motion": "controllers.models.linear_motion",
    "controllers.local_model": "controllers.models.local_model",
    "controllers.moment_pid": "controllers.exercise.moment_pid",
    "controllers.motion": "controllers.models.nominal_motion",
    "controllers.muscle": "controllers.models.muscle",
    "controllers.network": "controllers.policies.network",
    "controllers.nominal": "controllers.models.model_key",
    "controllers.pilot": "controllers.policies.adapter",
    "controllers.pilots": "controllers.policies.batch_adapter",
    "controllers.plan": "controllers.models.attainable_reference",
    "controllers.plan_search": "controllers.design.bounded_least_squares",
    "controllers.policy_document": "controllers.policies.document",
    "controllers.policy_file": "controllers.policies.policy_file",
    "controllers.policy_tensors": "controllers.policies.tensors",
    "controllers.practised_policy": "controllers.policy_with_ilc",
    "controllers.pressure": "controllers.observers.pressure_filter",
    "controllers.rehearsal": "controllers.models.nominal_rollout",
    "controllers.resistance": "controllers.exercise.resistance",
    "controllers.scales": "controllers.policies.scales",
    "controllers.scheduled_pressure": "controllers.exercise.scheduled_pressure",
    "controllers.serres": "controllers.serres_feedforward",
    "controllers.speed_pid": "controllers.exercise.speed_pid",
    "controllers.stroke": "controllers.models.operating_range",
    "controllers.tensor_header": "controllers.policies.tensor_header",
    "controllers.view": "controllers.policies.observation_spec",
}
"""Modules of controllers by their old names, which import with a deprecation warning."""
