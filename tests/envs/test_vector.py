"""An environment in a batch is the environment alone, bit for bit."""

import numpy as np
import pytest

from pma_gym.envs import PMAVectorEnv
from pma_gym.plant.model import load_model, shipped_models
from pma_gym.plant.sensors import noise_levels
from pma_gym.tasks import EXERCISES, multisine

EPISODE = 51
"""Steps of a displacement at 10 Hz."""

LITERATURE = [
    pytest.param(name, "rotation", marks=pytest.mark.campaign)
    for name in sorted({*shipped_models()} - {"station"})
    if load_model(name).rig.balances_loads
]
"""The other models, whose laws are tested one by one in `tests/codegen`."""

SEVERAL = {
    "randomisation": "varied", "action_delay_s": 0.2, "observation_delay_s": 0.3, "history": 2,
    "preview": 3, "regulator_action": True, "reward": "smooth", "pressure_kpa": "random",
}  # fmt: skip
"""Nearly everything at once."""


def heavier(nominal, generator):
    """A slide of up to twice the mass."""
    mass = nominal.values_in_files("slide")["mass_kg"]
    return nominal.replace({"slide.mass_kg": mass * (1.0 + generator.random())})


def smooth(error_percent, action_change, position, reference):
    """The reward `smooth`, as a user would write it."""
    return -abs(error_percent) - 0.1 * action_change


RANDOM = {"pressure_kpa": "random", "max_episode_steps": 40}
BOTH = "regulator_and_hand_push"
CASES = {
    "alone": (1, 1, {}),
    "all lanes": (16, 1, {}),
    "one more": (17, 2, {}),
    "many": (33, 2, {}),
    "own reward": (
        17, 2, RANDOM | {"randomisation": "intervals", "tolerance": 5e-3, "reward": smooth,
        "reward_scale": 0.25, "autoreset_mode": "SameStep"},
    ),
    "own randomisation": (3, 1, RANDOM | {"randomisation": heavier}),
    "nearly everything": (
        18, 1, RANDOM | SEVERAL | {"task": "rotation", "model": "station", "disturbances": BOTH},
    ),
    "multisine": (
        18, 1, RANDOM | {"task": multisine("extension", 5), "model": "cascade", "noise": False,
        "preview": 4, "control_rate_hz": 384.0 / 5.0},
    ),
    "isotonic": (
        17, 1, RANDOM | {"task": "isotonic", "model": "station", "randomisation": "varied",
        "disturbances": BOTH, "autoreset_mode": "SameStep"},
    ),
    **{
        f"drawn references, {mode}": (
            9, 2, RANDOM | {"task": "displacement_speeds", "reference": "random", "preview": 2,
            "autoreset_mode": mode, "reward": reward},
        )
        for mode, reward in (("NextStep", "absolute"), ("SameStep", smooth))
    },
    **{
        task: (5, 2, RANDOM | {"task": task, "model": "station", "control_rate_hz": 100.0})
        for task in EXERCISES
    },
}  # fmt: skip
"""How many environments, threads, and options of each environment."""


@pytest.mark.parametrize("case", CASES)
def test_a_batch_is_gymnasiums_own_loop(twins, fragile, case):
    count, threads, options = CASES[case]
    both = twins(count, batch={"threads": threads}, **({"model": fragile} | options))
    both.reset(seed=5)
    for _ in range(3 * EPISODE):
        both.step()
    assert both.ends.sum() > 2 * count
    # Episodes that go on are begun anew as well.
    both.reset()
    both.step()


@pytest.mark.parametrize(("threads", "options"), [(2, {}), (5, {"randomisation": "varied"})])
def test_threads_begin_many_episodes_as_one_does(monkeypatch, threads, options):
    made = {"model": "serres2008", "control_rate_hz": 10.0, "pressure_kpa": "random"}
    one, many = (
        PMAVectorEnv(70, autoreset_mode="Disabled", threads=count, **made, **options)
        for count in (1, threads)
    )
    # What it does alone is what few episodes are worth.
    original, begun = many.engine.kernel.begin, []
    monkeypatch.setattr(
        many.engine.kernel, "begin", lambda *given: (begun.append(given), original(*given))
    )
    mask = np.random.default_rng(3).uniform(size=70) < 0.7
    few = np.arange(70) % 9 == 4
    assert few.sum() < 32 < mask.sum()
    for turn, given in enumerate(({}, {"reset_mask": mask}, {"reset_mask": few})):
        first, again = (envs.reset(seed=turn, options=given)[0] for envs in (one, many))
        np.testing.assert_array_equal(first, again)
        np.testing.assert_array_equal(one.engine.records, many.engine.records)
        np.testing.assert_array_equal(one.pressures, many.pressures)
        assert len(begun) == (turn == 2)
        actions = np.linspace(-1.0, 1.0, 70)[:, None]
        np.testing.assert_array_equal(one.step(actions)[0], many.step(actions)[0])


@pytest.mark.parametrize("width", [4, 16])
def test_the_lanes_of_any_processor_give_the_same_bits(monkeypatch, twins, fragile, width):
    monkeypatch.setattr("pma_gym.engine.engine_memory.simd_lanes", lambda single=False: width)
    both = twins(18, model=fragile, randomisation="varied")
    assert both.batch.engine.width == width
    both.reset(seed=4)
    for _ in range(2 * EPISODE):
        both.step()
    assert both.ends[0].sum() > 18


def test_pressures_of_some_episodes_are_for_those_alone():
    made = {"model": "serres2008", "control_rate_hz": 10.0}
    envs = PMAVectorEnv(3, pressures_kpa=[200.0, 300.0, [500.0]], **made)
    for options, wanted in (
        ({"pressure_kpa": 444.0}, [444.0] * 3),
        ({"pressures_kpa": [250.0, [350.0], 450.0]}, [250.0, 350.0, 450.0]),
        ({}, [200.0, 300.0, 500.0]),
        (
            {
                "pressures_kpa": [500, 350, 450],
                "reset_mask": np.array([False, True, True]),
            },
            [200.0, 350.0, 450.0],
        ),
    ):
        envs.reset(seed=1, options=options)
        assert envs.station_info()["pressure_kpa"] == pytest.approx(wanted)


def test_without_autoreset_a_mask_says_who_begins_anew(twins, fragile):
    both = twins(17, autoreset_mode="Disabled", model=fragile, randomisation="varied")
    both.reset(seed=2)
    for k in range(3 * EPISODE):
        over = both.step()
        if over.any():
            # Some with a seed of their own, some going on with theirs.
            seeds = None if k % 2 else [k + i if i % 3 else None for i in range(17)]
            both.reset(seed=seeds, options={"reset_mask": over})
    assert both.ends[0].sum() > 30


def test_each_environment_has_its_own_pressures(twins):
    pressures = [200.0, [300.0, 400], "random", 575]
    both = twins(4, autoreset_mode="SameStep", pressures_kpa=pressures)
    both.reset(seed=4)
    started = []
    for _ in range(4 * EPISODE + 10):
        if both.step(-1.0, -0.9).any():
            started.append(both.batch.engine.pressures.copy() / 1e3)
    low, listed, drawn, high = np.transpose(started)
    assert set(low) == {200.0} and set(high) == {575.0}
    assert set(listed) <= {300.0, 400.0} and len(set(drawn)) > 2


@pytest.mark.parametrize(
    ("model", "task"), [("station", "rotation"), ("cascade", "displacement"), *LITERATURE]
)
def test_single_precision_is_near(model, task):
    made = {"model": model, "noise": False, "pressure_kpa": "random"}
    envs = [PMAVectorEnv(17, task, precision=p, **made) for p in ("double", "single")]
    for one in envs:
        one.reset(seed=8)
    key, worst = envs[0].engine.state_layout.info[1], np.zeros(17)
    for k in range(400):
        volts = 3.0 * np.sin(0.01 * k) ** 2
        results = [one.step(np.full((17, 1), 0.2 * volts - 1.0)) for one in envs]
        assert results[1][1].dtype == np.float64 and not results[1][2].any()
        positions = [one.station_info()[key] for one in envs]
        worst = np.maximum(worst, np.abs(np.subtract(*positions)))
    share = worst / {"displacement": 25.0, "rotation": 90.0}[task]
    # Where rounding decides when friction lets go, a trial may come out a little otherwise.
    assert 0.0 < np.median(share) < 2e-5 and share.max() < 1e-2


def test_single_precision_gives_the_same_bits_in_any_batch():
    actions = np.random.default_rng(0).uniform(-1.0, 0.0, (60, 33, 1))
    batches = []
    for count, threads in ((33, 1), (33, 2), (17, 1)):
        envs = PMAVectorEnv(count, model="station", precision="single", threads=threads)
        envs.reset(seed=3)
        steps = [envs.step(actions[k, :count]) for k in range(60)]
        batches.append((np.array([s[0] for s in steps]), np.array([s[1] for s in steps])))
    for observations, rewards in batches[1:]:
        count = observations.shape[1]
        np.testing.assert_array_equal(observations, batches[0][0][:, :count])
        np.testing.assert_array_equal(rewards, batches[0][1][:, :count])


@pytest.mark.parametrize(
    ("model", "task"), [("station", "rotation"), ("cascade", "displacement"), *LITERATURE]
)
def test_parked_stations_disturb_nobody(model, task):
    mode = "NextStep" if task == "rotation" else "SameStep"
    weak = load_model(model).replace({"limits.tension_n": 5.0})
    made = {"noise": False, "pressure_kpa": 300.0}
    envs = PMAVectorEnv(19, task, model=weak, autoreset_mode=mode, **made)
    envs.reset(seed=0)
    ends = 0
    for _ in range(40):
        observations, rewards, terminated, *_ = envs.step(np.ones((19, 1)))
        ends += int(terminated.sum())
        assert np.isfinite(observations).all() and np.isfinite(rewards).all()
        assert envs.engine.attempts < 20_000
        numbers = envs.engine.records[:, : len(envs.engine.state_layout.states)]
        assert np.isfinite(numbers).all()
    assert ends >= 19


def test_lanes_without_an_environment_never_end():
    count = 17
    envs = PMAVectorEnv(count, "rotation", model="station", noise=False)
    envs.reset(seed=0)
    for _ in range(30):
        envs.engine.actions[:] = 0.0
        envs.engine.actions[:count] = -0.9
        assert envs.engine.step() == 0


def test_noise_of_a_batch_is_the_models_and_its_environments_own():
    model = load_model("serres2008")
    loud = {"lvdt.noise_mm": 1.0, "load_cell.noise_n": 20.0, "pressure_transducer.noise_kpa": 9.0}
    model = model.replace(loud | {"potentiometer.noise_deg": 5.0})
    envs = PMAVectorEnv(64, "rotation", model=model, pressure_kpa=300)
    envs.reset(seed=1)
    rest = np.full((64, 1), -1.0)
    readings = np.array([envs.step(rest)[0][:, :4] for _ in range(400)], float)
    readings *= [25e-3, np.pi / 2, 1000.0, 600e3]
    levels = noise_levels(model)
    # The standard deviation of 25600 normal numbers is known to 0.44 %; five of those.
    np.testing.assert_allclose(readings.std(axis=(0, 1)), levels, rtol=0.025)
    for quantity in range(4):
        one = readings[:, :, quantity] - readings[:, :, quantity].mean(axis=0)
        related = np.corrcoef(one.T)[np.triu_indices(64, 1)]
        # 2016 pairs of 400 numbers: five standard deviations of 0.05.
        assert np.abs(related).max() < 0.25
    # Nor does a step tell the next.
    assert np.abs((one[1:] * one[:-1]).mean() / one.var()) < 0.03
