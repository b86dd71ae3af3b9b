"""A network computes its equations, and the same bits for an observation alone or among many.

Policies that nobody trained: networks drawn at random, with the words of a real one.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.policies.adapter import ActionMapping
from controllers.policies.network import ACTIVATIONS, OUTPUTS, Layer, Network, Scaling, Weights
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


EVERY = [(a, o, s) for a in ACTIVATIONS for o in OUTPUTS for s in (False, True)]


@pytest.mark.parametrize(("activation", "output", "scaled"), EVERY)
def test_the_equations(activation, output, scaled):
    weights = drawn_weights((7, 5, 3, 2), activation, output, scaled)
    observation = np.random.default_rng(1).normal(size=7)
    values = observation
    if scaled:
        mean, variance, epsilon, clip = weights.scaling
        values = np.clip((values - mean) / np.sqrt(variance + epsilon), -clip, clip)
        values = values.astype(np.float32)
    f = {"tanh": np.tanh, "relu": lambda x: np.where(x > 0.0, x, 0.0)}[activation]
    for weight, bias in weights.layers[:-1]:
        values = f(weight.astype(float) @ values + bias)
    last = weights.layers[-1].weight.astype(float) @ values + weights.layers[-1].bias
    wanted = np.tanh(last) if output == "tanh" else np.clip(last, -1.0, 1.0)
    np.testing.assert_allclose(Network(weights)(observation), wanted, rtol=1e-14, atol=1e-15)


@given(count=st.integers(0, 7), seed=st.integers(0, 99), start=st.integers(0, 3))
def test_alone_or_among_many_are_the_same_bits(count, seed, start):
    draw = np.random.default_rng(seed)
    weights = drawn_weights(output="tanh", seed=seed)
    # Rows at every alignment that a slice of somebody's array may have.
    memory = draw.normal(size=count * 48 + start).astype(np.float32)[start:]
    rows = memory.reshape(count, 48)
    many = Network(weights).many(rows)
    alone = [Network(weights)(row.copy()) for row in rows]
    assert many.shape == (count, 1)
    assert many.tobytes() == b"".join(one.tobytes() for one in alone)


def test_what_it_gave_stays():
    network = Network(drawn_weights(output="tanh"))
    first = network(np.ones(48))
    kept = first.copy()
    network(np.zeros(48))
    assert first == kept


def test_an_observation_is_not_written_to():
    observation = np.ones(48)
    Network(drawn_weights(scaled=True))(observation)
    assert np.all(observation == 1.0)


def test_large_actions_are_held_to_the_range():
    layer = Layer(np.array([[1000.0]], np.float32), np.zeros(1, np.float32))
    for output in OUTPUTS:
        network = Network(Weights((layer,), "relu", output))
        assert [float(network(np.array([x]))[0]) for x in (-1.0, 0.0, 1.0)] == [-1.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"activation": "gelu"}, "activation must be one of tanh, relu, got 'gelu'"),
        ({"output": "none"}, "output must be one of clip, tanh, got 'none'"),
        ({"layers": ()}, "at least one layer, got none"),
        (
            {"scaling": Scaling(np.zeros(3), np.ones(3), 1e-8, 10.0)},
            r"mean must have a value for each of the 4 entries .*, got shape \(3,\)",
        ),
        (
            {"scaling": Scaling(np.zeros(4), np.array([1.0, 1.0, -2.0, 1.0]), 1e-8, 10.0)},
            "variance must not be negative, .* got a least variance of -2",
        ),
    ],
)
def test_what_cannot_be_computed_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Network(drawn_weights((4, 2, 1))._replace(**changes))


def test_layers_that_do_not_chain_are_refused():
    first, *_ = drawn_weights((4, 2, 1)).layers
    *_, last = drawn_weights((4, 3, 1)).layers
    with pytest.raises(ValueError, match="layer 1 takes 3 values, layer 0 gives 2"):
        Network(Weights((first, last), "tanh", "clip"))
    with pytest.raises(ValueError, match=r"takes an observation of shape \(4,\), got \(2, 4\)"):
        Network(drawn_weights((4, 1)))(np.zeros((2, 4)))
