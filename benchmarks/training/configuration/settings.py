"""Settings of the algorithms in a preset: which there are, and what values they may have."""

import difflib
import reprlib
from collections.abc import Iterable, Mapping
from typing import Any

from benchmarks.training.configuration.zoo_text import ACTIVATIONS, network_text
from pma_gym.numerals import parse_number

_shown = reprlib.repr

_COMMON = {"batch_size", "gamma", "learning_rate"}
_REPLAY = _COMMON | {"buffer_size", "gradient_steps", "learning_starts", "tau", "train_freq"}

SETTINGS = {
    "ppo": _COMMON
    | {
        "clip_range",
        "ent_coef",
        "gae_lambda",
        "max_grad_norm",
        "n_epochs",
        "n_steps",
        "target_kl",
        "vf_coef",
    },
    "sac": _REPLAY | {"ent_coef"},
    "td3": _REPLAY | {"policy_delay", "target_noise_clip", "target_policy_noise"},
    "tqc": _REPLAY | {"ent_coef", "top_quantiles_to_drop_per_net"},
}
"""Settings of each algorithm that are numbers."""

WHOLE = {
    "batch_size",
    "buffer_size",
    "gradient_steps",
    "learning_starts",
    "n_epochs",
    "n_steps",
    "policy_delay",
    "top_quantiles_to_drop_per_net",
    "train_freq",
}
"""Those that are whole numbers."""

SHARES = {"gae_lambda", "gamma", "tau"}
"""Those that lie in 0 to 1."""

FALLING = {"clip_range", "learning_rate"}
"""Those that may fall: "lin_0.001" falls linearly from 0.001 to 0."""

NETWORK = {"activation_fn", "net_arch", "log_std_init", "n_critics", "n_quantiles"}
"""Settings of the network."""

PARTS = {"pi", "vf", "qf"}
"""Parts of a network that may have layers of their own: actor, critic on states, on actions too."""


def setting(algorithm: str, key: str, value: object) -> float | int | str:
    """A setting's value, checked; whole numbers as such.

    Raises:
        ValueError: one that the algorithm has not, with the nearest; or a value out of range.
    """
    known = SETTINGS[algorithm]
    if key not in known:
        raise ValueError(f"{algorithm} has no setting {key!r}{nearest(key, known)}")
    if isinstance(value, str):
        return _worded(algorithm, key, value)
    if key in WHOLE:
        # -1 gradient steps: as many as control steps were taken.
        return whole(key, value, {"gradient_steps": -1, "learning_starts": 0}.get(key, 1))
    number = real(key, value)
    if number < 0.0 or key in SHARES and number > 1.0:
        rule = "lie in 0 to 1" if key in SHARES else "not be negative"
        raise ValueError(f"{key} must {rule}, got {_shown(value)}")
    return number


def _worded(algorithm: str, key: str, value: str) -> str:
    """A value that is no number: one that falls, or SB3's automatic temperature."""
    automatic = key == "ent_coef" and algorithm != "ppo"
    start, _, number = value.partition("_")
    if automatic and value == "auto":
        return value
    if (start == "lin" and key in FALLING or start == "auto" and automatic) and _is_number(number):
        return value
    forms = ["a number"]
    forms += ['"lin_" and a number'] * (key in FALLING) + ['"auto"', '"auto_0.1"'] * automatic
    hint = "; YAML takes it for text: write 0.001 or 1.0e-3" if _is_number(value) else ""
    raise ValueError(f"{key} must be {' or '.join(forms)}, got {_shown(value)}{hint}")


def network(given: object) -> dict[str, Any]:
    """Settings of the network, checked.

    Args:
        given: a mapping, or text such as the zoo evaluates; the latter alone can name an activation
            in a way that the zoo understands too.

    Raises:
        ValueError: one that is unknown or of the wrong kind.
    """
    if isinstance(given, str):
        given = network_text(given)
    if not isinstance(given, Mapping) or not set(given) <= NETWORK:
        raise ValueError(
            f"policy_kwargs must be a mapping of {', '.join(sorted(NETWORK))}, got {_shown(given)}"
        )
    activation = given.get("activation_fn", ACTIVATIONS[0])
    if activation not in ACTIVATIONS:
        raise ValueError(
            f"activation_fn must be one of {', '.join(ACTIVATIONS)}, got {_shown(activation)}"
        )
    arch = given.get("net_arch", [])
    if isinstance(arch, Mapping) and not set(arch) <= PARTS:
        raise ValueError(f"net_arch must name {', '.join(sorted(PARTS))} alone, got {_shown(arch)}")
    for layers in arch.values() if isinstance(arch, Mapping) else [arch]:
        if not isinstance(layers, list):
            raise ValueError(f"net_arch must be a list such as [64, 64], got {_shown(arch)}")
        for size in layers:
            whole("a layer of net_arch", size)
    if "log_std_init" in given:
        real("log_std_init", given["log_std_init"])
    for key in sorted({"n_critics", "n_quantiles"} & set(given)):
        whole(key, given[key])
    return dict(given)


def whole(name: str, value: object, least: int = 1) -> int:
    """A whole number; 3.0e6 is one.

    Raises:
        ValueError: none, or one that is too small.
    """
    number = real(name, value)
    if number != int(number) or number < least:
        raise ValueError(f"{name} must be a whole number from {least} up, got {_shown(value)}")
    return int(number)


def real(name: str, value: object) -> float:
    """A finite number.

    Raises:
        ValueError: none.
    """
    number = isinstance(value, int | float) and not isinstance(value, bool)
    # A whole number beyond the doubles fits in none.
    if not number or not abs(value) < 1e308:  # type: ignore[arg-type]
        text = isinstance(value, str) and _is_number(value)
        hint = "; YAML takes it for text: write 0.001 or 1.0e-3" if text else ""
        raise ValueError(f"{name} must be a finite number, got {_shown(value)}{hint}")
    return value  # type: ignore[return-value]


def mapping(name: str, value: object) -> dict[str, Any]:
    """A mapping, as a copy.

    Raises:
        ValueError: none.
    """
    if not isinstance(value, Mapping):
        raise ValueError(f"{name} must be a mapping of names to values, got {_shown(value)}")
    return dict(value)


def nearest(name: str, known: Iterable[str]) -> str:
    """Asks whether the nearest known name was meant, if there is one near."""
    close = difflib.get_close_matches(name, sorted(known), n=1, cutoff=0.5)
    return f"; did you mean {close[0]!r}?" if close else ""


def _is_number(text: str) -> bool:
    number = parse_number(text)
    return number is not None and number >= 0.0
