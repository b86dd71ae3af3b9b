"""Policy files from models of Stable-Baselines3: PPO, SAC, TD3 and TQC with an MlpPolicy."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces

from benchmarks.training.policy_export.agreement import ExportError, check_agreement
from controllers.policies.adapter import ActionMapping
from controllers.policies.network import Layer, Scaling, Weights
from controllers.policies.observation_spec import ObservationSpec
from controllers.policies.policy_file import PolicyFile

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecNormalize
    from torch import nn

__all__ = ["ExportError", "policy_from_sb3", "weights_from_sb3"]

ONLY = "only an MlpPolicy of PPO, SAC, TD3 or TQC can be exported"

OUTPUTS = {
    "stable_baselines3.common.policies.ActorCriticPolicy": "clip",
    "stable_baselines3.sac.policies.SACPolicy": "tanh",
    "stable_baselines3.td3.policies.TD3Policy": "tanh",
    "sb3_contrib.tqc.policies.TQCPolicy": "tanh",
}
"""MlpPolicy's classes and what has their networks, and what keeps their actions in -1..1."""


def policy_from_sb3(
    model: "BaseAlgorithm",
    *,
    name: str,
    title: str,
    task: str,
    environment: Mapping[str, Any],
    view: ObservationSpec,
    form: ActionMapping,
    observation: Sequence[tuple[str, str]],
    training: Mapping[str, Any],
    statistics: "VecNormalize | None" = None,
) -> PolicyFile:
    """A policy from a trained model; what it is for is said beside it, as in `PolicyFile`.

    Args:
        model: PPO, SAC, TD3 or TQC with an MlpPolicy.
        name: what results call it.
        title: what reports call it.
        task: kind of the task.
        environment: id and kwargs.
        view: what it sees.
        form: what its action does.
        observation: (entry, what 1.0 stands for) in order.
        training: where it comes from.
        statistics: VecNormalize that it was trained in, if it was.
    Raises:
        ExportError: a model that no policy file holds; says why.
    """
    weights = weights_from_sb3(model, statistics)
    if len(observation) != weights.sizes[0]:
        raise ExportError(
            f"the model takes {weights.sizes[0]} entries of an observation, the view has "
            f"{len(observation)}; export it with the view that it was trained with"
        )
    return PolicyFile(
        name,
        title,
        weights,
        task,
        environment,
        view,
        tuple((entry, unit) for entry, unit in observation),
        form,
        training,
    )


def weights_from_sb3(model: "BaseAlgorithm", statistics: "VecNormalize | None" = None) -> Weights:
    """The network that computes a model's deterministic actions; checked to give the same.

    Args:
        model: PPO, SAC, TD3 or TQC with an MlpPolicy.
        statistics: VecNormalize that it was trained in, if it was.
    Raises:
        ExportError: a model that no policy file holds; says why.
    """
    _check_spaces(model)
    output = _check_policy(model)
    layers, activation = _layers(_modules(model))
    weights = Weights(layers, activation, output, _scaling(statistics))
    bad = sum(int(np.count_nonzero(~np.isfinite(part))) for layer in layers for part in layer)
    if bad:
        raise ExportError(
            f"the model's weights must be finite, {bad} of them are NaN or infinite: the training "
            "diverged; export an earlier checkpoint"
        )

    def predicted(rows: Any) -> Any:  # noqa: ANN401
        seen = statistics.normalize_obs(rows) if statistics else rows
        return model.predict(seen, deterministic=True)[0]

    check_agreement("the model's deterministic predict", weights, predicted)
    return weights


def _check_spaces(model: "BaseAlgorithm") -> None:
    seen, action = model.observation_space, model.action_space
    if not isinstance(seen, spaces.Box) or len(seen.shape) != 1 or seen.dtype.kind != "f":
        raise ExportError(f"the model's observations must be rows of floats, it takes {seen}")
    wanted = spaces.Box(-1.0, 1.0, (1,), np.float32)
    if action != wanted:
        raise ExportError(
            f"the model must have one action of -1 to 1, {wanted}, it has {action}; train it on "
            "the environment itself"
        )


def _check_policy(model: "BaseAlgorithm") -> str:
    """What keeps its actions in -1..1."""
    policy = model.policy
    for extractor in _extractors(policy):
        if type(extractor).__name__ != "FlattenExtractor":
            raise ExportError(
                f"{ONLY}; this one's observations go through a {type(extractor).__name__}"
            )
    if getattr(model, "use_sde", False):
        raise ExportError(
            f"{ONLY}; this one explores by its state (use_sde), which changes its network; train "
            "it with use_sde=False"
        )
    kind = f"{type(policy).__module__}.{type(policy).__qualname__}"
    if kind not in OUTPUTS:
        raise ExportError(f"{ONLY}; this {type(model).__name__} has a {kind}")
    return OUTPUTS[kind]


def _extractors(policy: Any) -> list[Any]:  # noqa: ANN401 - attributes differ by its class
    actor = getattr(policy, "actor", policy)
    names = ("pi_features_extractor", "features_extractor")
    extractors = [getattr(actor, name, None) for name in names]
    return [extractor for extractor in extractors if extractor is not None]


def _modules(model: "BaseAlgorithm") -> "list[nn.Module]":
    """The actor's modules in order, up to its mean action."""
    from torch import nn

    policy: Any = model.policy
    if hasattr(policy, "mlp_extractor"):
        return [*policy.mlp_extractor.policy_net, policy.action_net]
    if hasattr(policy.actor, "latent_pi"):
        return [*policy.actor.latent_pi, policy.actor.mu]
    *modules, last = policy.actor.mu
    if not isinstance(last, nn.Tanh):
        raise ExportError(f"{ONLY}; this one's network ends with {last}, not with Tanh")
    return modules


def _layers(modules: "Sequence[nn.Module]") -> tuple[tuple[Layer, ...], str]:
    """Layers and the activation between them: Linear, activation, Linear and so on."""
    from torch import nn

    known = {nn.Tanh: "tanh", nn.ReLU: "relu"}
    between = {type(module) for module in modules[1::2]}
    linear = all(type(module) is nn.Linear for module in modules[::2]) and len(modules) % 2
    if not linear or len(between) > 1 or not between <= set(known):
        names = ", ".join(type(module).__name__ for module in modules)
        raise ExportError(
            f"a policy file has Linear layers with Tanh or with ReLU between them, this model has "
            f"{names}; train it with activation_fn Tanh or ReLU"
        )
    activation = known[between.pop()] if between else "tanh"
    return tuple(_converted(modules[::2])), activation


def _converted(modules: "Sequence[Any]") -> Iterator[Layer]:
    for module in modules:
        weight = module.weight.detach().cpu().numpy()
        none = np.zeros(len(weight), np.float32)
        bias = none if module.bias is None else module.bias.detach().cpu().numpy()
        # Copies: training on must not change what was exported.
        yield Layer(weight.astype(np.float32), bias.astype(np.float32))


def _scaling(statistics: "VecNormalize | None") -> Scaling | None:
    if statistics is None or not statistics.norm_obs:
        return None
    seen: Any = statistics.obs_rms
    if isinstance(seen, Mapping):
        raise ExportError(f"the statistics must be of one row of entries, they are of {list(seen)}")
    return Scaling(
        np.array(seen.mean, np.float64),
        np.array(seen.var, np.float64),
        float(statistics.epsilon),
        float(statistics.clip_obs),
    )
