"""The zoo's way to write a network, as Python text, read without evaluating anything.

rl-baselines3-zoo evaluates `policy_kwargs` where it is text, for only so can YAML name a class:

    policy_kwargs: "dict(net_arch=[64, 64], activation_fn=nn.ReLU)"

Files from strangers are data, so here the text is parsed, and nothing but `dict(...)`, lists,
numbers and the names of activations has a meaning.
"""

import ast

ACTIVATIONS = ("nn.ReLU", "nn.Tanh")
"""Activations that a policy file can hold, by the names that the zoo knows them by."""


LONGEST = 1000
"""Most characters of such a text."""


def network_text(text: str) -> dict[str, object]:
    """Parse a text of `policy_kwargs`.

    Returns:
        Its keywords; an activation by its name, one of `ACTIVATIONS`.

    Raises:
        ValueError: what is no such text, or says more.
    """
    if len(text) > LONGEST:
        raise ValueError(f"policy_kwargs must have at most {LONGEST} characters, got {len(text)}")
    try:
        network = _value(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, ValueError) as error:
        why = getattr(error, "msg", error)
        raise ValueError(f"policy_kwargs is no Python text ({why}), got {text!r}") from error
    except (RecursionError, MemoryError) as error:
        raise ValueError("policy_kwargs is nested too deeply to be read") from error
    if not isinstance(network, dict):
        raise ValueError(f"policy_kwargs must be a dict(...), got {text!r}")
    return network


def _value(node: ast.expr) -> object:
    """Value of a part of the text."""
    match node:
        case ast.Call(func=ast.Name(id="dict"), args=[], keywords=keywords):
            names = [_key(one) for one in keywords]
            if twice := {name for name in names if names.count(name) > 1}:
                raise ValueError(f"policy_kwargs names {', '.join(sorted(twice))} twice")
            return {_key(one): _value(one.value) for one in keywords}
        case ast.Dict():
            raise ValueError(
                "policy_kwargs must be dict(name=value, ...) or a YAML mapping without quotes, "
                f"got {ast.unparse(node)!r}"
            )
        case ast.List(elts=parts):
            return [_value(part) for part in parts]
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return number
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant() as part) if not isinstance(
            part.value, bool
        ):
            number = _value(part)
            assert isinstance(number, int | float)
            return -number
        case ast.Attribute() if ast.unparse(node) in ACTIVATIONS:
            return ast.unparse(node)
    raise ValueError(
        "policy_kwargs may have dict(...), lists, numbers and the activations "
        f"{', '.join(ACTIVATIONS)}, got {ast.unparse(node)!r}; nothing is evaluated here"
    )


def _key(keyword: ast.keyword) -> str:
    if keyword.arg is None:
        raise ValueError("policy_kwargs must name each setting, got **; write dict(name=value)")
    return keyword.arg
