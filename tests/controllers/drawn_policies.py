"""Policies that nobody trained: networks drawn at random, with the words of a real one."""

import numpy as np

from controllers.policies.adapter import ActionMapping
from controllers.policies.network import Layer, Scaling, Weights
from controllers.policies.observation_spec import ObservationSpec
from controllers.policies.policy_file import PolicyFile


def drawn_weights(sizes=(48, 64, 64, 1), activation="tanh", output="clip", scaled=False, seed=0):
    draw = np.random.default_rng(seed)
    layers = tuple(
        Layer(
            (draw.normal(size=(outputs, inputs)) / np.sqrt(inputs)).astype(np.float32),
            draw.normal(size=outputs).astype(np.float32) * np.float32(0.1),
        )
        for inputs, outputs in zip(sizes, sizes[1:], strict=False)
    )
    scaling = Scaling(draw.normal(size=sizes[0]), draw.uniform(0.1, 4.0, sizes[0]), 1e-8, 10.0)
    return Weights(layers, activation, output, scaling if scaled else None)


def drawn_policy(station, name="displacement-100hz-ppo", view=None, form=None, **network):
    """A policy as if trained for a station."""
    view, form = view or ObservationSpec("environment", 2, 3), form or ActionMapping("direct", 5.0)
    rows = view.rows(station, form.base)
    return PolicyFile(
        name=name,
        title="PPO",
        weights=drawn_weights((len(rows), 64, 64, 1), **network),
        task="displacement",
        environment={
            "id": "pma_gym/IsokineticDisplacement-v0",
            "kwargs": {
                "control_rate_hz": 1.0 / station.period,
                "action_delay_s": station.action_delay,
                "observation_delay_s": station.observation_delay,
                "model": station.model.name,
            },
        },
        view=view,
        observation=tuple(rows),
        form=form,
        training={
            "algorithm": "ppo",
            "preset": None,
            "seed": 1,
            "steps": 1000,
            "wall_s": 2.5,
            "code": None,
            "curve": [[500, 1.25, 0.4], [1000, 2.5, 0.2]],
            "scores": {"rmse_mm": 0.2},
        },
    )
