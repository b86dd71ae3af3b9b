"""`python -m benchmarks export`: somebody's own model, trained on a registered environment."""

import json
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym

from benchmarks.training.policy_export.from_sb3 import ExportError, policy_from_sb3
from benchmarks.training.policy_export.onnx_file import onnx_bytes
from controllers.design.designs import task_kind
from controllers.policies.adapter import MIDDLE_V, ActionMapping
from controllers.policies.observation_spec import ObservationSpec
from controllers.policies.policy_file import PolicyFile, policy_pair, save_policy_file
from pma_gym.documents import parse_json
from pma_gym.envs import ENVIRONMENTS, PMAEnv
from pma_gym.files import check_output, replace_file
from pma_gym.limits import check_limit, limit

ALGORITHMS = {
    "ppo": ("stable_baselines3", "PPO"),
    "sac": ("stable_baselines3", "SAC"),
    "td3": ("stable_baselines3", "TD3"),
    "tqc": ("sb3_contrib", "TQC"),
}
"""Where each algorithm's class is."""

ACTOR_CRITIC = ("stable_baselines3.common.policies",)
"""Where policies are that PPO shares with A2C; only PPO has a `clip_range`."""

UNREADABLE = (
    zipfile.BadZipFile,
    zlib.error,
    OSError,
    EOFError,
    RuntimeError,
    KeyError,
    TypeError,
    ValueError,
)
"""What reading a zip raises that is damaged, encrypted, or packed in a way that Python lacks."""

LOOP = ("control_rate_hz", "action_delay_s", "observation_delay_s")


class Order(NamedTuple):
    """Request for an export.

    Attributes:
        model: zip that Stable-Baselines3 saved.
        environment: id of the environment that it was trained on.
        kwargs: keyword arguments of that environment.
        out: NAME of the policy, its folder before it.
        algorithm: `ppo`, `sac`, `td3` or `tqc`; read off the zip if empty.
        statistics: file that a VecNormalize saved, if it was trained in one.
        onnx: whether NAME.onnx is written too.
        trusted: whether whoever made the zip may run code on this machine.
    """

    model: Path
    environment: str
    kwargs: Mapping[str, Any]
    out: Path
    algorithm: str = ""
    statistics: Path | None = None
    onnx: bool = False
    trusted: bool = False


def export_model(order: Order) -> list[Path]:
    """Write the policy file of somebody's own model.

    Returns:
        The files written.
    Raises:
        ExportError: a model that cannot be exported; says why and what to do.
        OutputError: a file that cannot be written; nothing is.
        PolicyError: a policy that would not load.
    """
    for path in (order.model, order.statistics):
        if path is not None and not path.is_file():
            raise ExportError(f"there is no file {path}; check the name and the folder")
    if not order.trusted:
        raise ExportError(
            f"{order.model} is not loaded: what Stable-Baselines3 saves holds pickles, and loading "
            "one runs whatever code its maker put there. If you trust where it comes from, add "
            "--trust; the policy file that is written is data alone"
        )
    words, weights = policy_pair(order.out)
    target = words.with_suffix(".onnx")
    written = [words, weights, *([target] if order.onnx else [])]
    for path in written:
        check_output(path)
    policy = _policy(order, words.stem)
    graph = onnx_bytes(policy) if order.onnx else b""
    save_policy_file(policy, order.out)
    if order.onnx:
        replace_file(target, graph)
    return written


def parsed_kwargs(text: str) -> dict[str, Any]:
    """Keyword arguments of an environment from JSON.

    Raises:
        ExportError: no JSON object.
    """
    try:
        kwargs = parse_json(text.encode("utf-8", "surrogateescape"), "--env-kwargs")
    except ValueError as error:
        kwargs = error
    if not isinstance(kwargs, dict):
        why = f" ({kwargs})" if isinstance(kwargs, ValueError) else ""
        raise ExportError(
            f"--env-kwargs must be a JSON object such as '{{\"preview\": 4}}', got {text!r}{why}"
        )
    return kwargs


def _policy(order: Order, name: str) -> PolicyFile:
    env = _environment(order.environment, order.kwargs)
    algorithm = order.algorithm or algorithm_of(order.model)
    model = _loaded(order.model, algorithm)
    _check_spaces(order, model, env)
    options, station = env.options, env.station
    view, form = (
        ObservationSpec("environment", options.preview, options.history),
        ActionMapping("direct", MIDDLE_V),
    )
    used = {key: getattr(options, key) for key in LOOP} | {"model": str(options.model)}
    return policy_from_sb3(
        model,
        name=name,
        title=f"{algorithm.upper()} ({name})",
        task=task_kind(station),
        environment={"id": order.environment, "kwargs": {**order.kwargs, **used}},
        view=view,
        form=form,
        observation=view.rows(station, form.base),
        training={
            "algorithm": algorithm,
            "preset": None,
            "seed": model.seed,
            "steps": int(model.num_timesteps),
            "wall_s": None,
            "code": None,
            "curve": [],
            "scores": {},
        },
        statistics=_statistics(order.statistics, env),
    )


def _environment(name: str, kwargs: Mapping[str, Any]) -> PMAEnv:
    if name not in ENVIRONMENTS:
        raise ExportError(f"--env must be one of {', '.join(ENVIRONMENTS)}, got {name!r}")
    try:
        env: Any = gym.make(name, **kwargs).unwrapped
    except (TypeError, ValueError) as error:
        raise ExportError(f"--env-kwargs: {error}") from None
    return env


def algorithm_of(path: Path) -> str:
    """The algorithm that a zip of Stable-Baselines3 is of, read without unpickling anything.

    Raises:
        ExportError: no such zip, or an algorithm that cannot be exported.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            data = parse_json(_member(path, archive, "data"), f"{path}, data", finite=False)
        module = str(data["policy_class"]["__module__"])
    except UNREADABLE as error:
        raise ExportError(
            f"{path} must be a zip that Stable-Baselines3 saved (model.save), it cannot be read "
            f"as one ({error}); save the model anew"
        ) from None
    package = module.split(".")[-2] if "." in module else ""
    name = "ppo" if module in ACTOR_CRITIC and "clip_range" in data else package
    if name not in ALGORITHMS:
        raise ExportError(
            f"{path} must be of one of {', '.join(ALGORITHMS)}, its policy is of {module}; if it "
            "is of one of these, say which: --algo"
        )
    return name


def _member(path: Path, archive: zipfile.ZipFile, name: str) -> bytes:
    """A file of a zip, no more of it than the limit on documents, whatever the zip announces."""
    check_limit(f"{name} in {path}", "journal_mib", archive.getinfo(name).file_size / 2**20)
    with archive.open(name) as file:
        content = file.read((limit("journal_mib") << 20) + 1)
    check_limit(f"{name} in {path}", "journal_mib", len(content) / 2**20)
    return content


def _loaded(path: Path, algorithm: str) -> Any:  # noqa: ANN401 - a model of any algorithm
    if algorithm not in ALGORITHMS:
        raise ExportError(f"--algo must be one of {', '.join(ALGORITHMS)}, got {algorithm!r}")
    package, name = ALGORITHMS[algorithm]
    try:
        kind = getattr(__import__(package), name)
    except ImportError:
        raise ExportError(
            f"reading a model of {name} needs {package}, which is not installed: "
            "pip install -c constraints.txt -e '.[rl]'"
        ) from None
    try:
        return kind.load(path, device="cpu")
    # Whatever is in the zip is executed and may raise anything.
    except Exception as error:
        raise ExportError(
            f"{path} cannot be loaded as a {name} ({type(error).__name__}: {error}); name its "
            "algorithm by --algo, with the versions installed that saved it"
        ) from error


def _check_spaces(order: Order, model: Any, env: PMAEnv) -> None:  # noqa: ANN401
    for what, came, wanted in (
        ("observations", model.observation_space, env.observation_space),
        ("actions", model.action_space, env.action_space),
    ):
        if came != wanted:
            raise ExportError(
                f"{order.model} was trained with {what} {came}, {order.environment} with "
                f"{json.dumps(dict(order.kwargs))} has {wanted}; give the keyword arguments that "
                "it was trained with by --env-kwargs, and train without wrappers that change them"
            )


def _statistics(path: Path | None, env: PMAEnv) -> Any:  # noqa: ANN401
    """The VecNormalize of a file, if there is one."""
    if path is None:
        return None
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    try:
        # It holds the statistics' shapes against the environment's itself.
        statistics = VecNormalize.load(str(path), DummyVecEnv([lambda: env]))
    except Exception as error:
        raise ExportError(
            f"{path} must be statistics that a VecNormalize saved for this environment, it cannot "
            f"be read as them ({type(error).__name__}: {error})"
        ) from error
    statistics.training = False
    return statistics
