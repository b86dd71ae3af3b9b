"""Rosenbrock methods with their own error estimates, to compare with the plant's integrator.

    (I / (gamma h) - J) u_i = f(y + sum_j a_ij u_j) + sum_j (c_ij / h) u_j
    y_new = y + sum_i m_i u_i,    error = sum_i e_i u_i

J is the exact Jacobian at the step's start, differentiated from the laws themselves. The plant was
integrated with van Veldhuizen's coefficients until `pma_gym.integrator.exponential_rosenbrock`
took half as many attempts at the same errors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pma_gym.codegen.derivative import derivatives
from pma_gym.codegen.graph import Value
from pma_gym.codegen.substitute import substitute
from pma_gym.integrator.elimination import solver
from pma_gym.integrator.equations import State
from pma_gym.integrator.exponential_rosenbrock import Step, substituted, total


@dataclass(frozen=True)
class Method:
    """Coefficients of a Rosenbrock method, in the form that needs no product with J.

    Attributes:
        gamma: diagonal coefficient.
        stages: a_ij by stage; None where a stage has the rates of the one before.
        couplings: c_ij by stage.
        weights: m_i.
        errors: e_i, the difference to the embedded method of order 3.
    """

    gamma: float
    stages: tuple[tuple[float, ...] | None, ...]
    couplings: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]
    errors: tuple[float, ...]


VELDHUIZEN = Method(
    gamma=0.2257081148225682,
    stages=((), (2.0,), (4.812234362695436, 4.578146956747842), None),
    couplings=(
        (),
        (-5.333333333333331,),
        (6.100529678848254, 1.804736797378427),
        (-2.540515456634749, -9.443746328915205, -1.988471753215993),
    ),
    weights=(4.289339254654537, 5.036098482851414, 0.6085736420673917, 1.355958941201148),
    errors=(2.175672787531755, 2.950911222575741, -0.7859744544887430, -1.355958941201148),
)
"""Order 4(3), three evaluations of the rates, A(89.4 deg)-stable.

Source: M. van Veldhuizen 1984, "D-stability and Kaps-Rentrop methods", Computing 32. The paper was
not at hand: the digits are those of public solvers that have the method in the form which needs no
product with the Jacobian (E. Hairer and G. Wanner's ROS4, OrdinaryDiffEq.jl's Veldd4), and a test
holds the conditions of order.
"""


def step(
    states: Sequence[State],
    size: Value,
    frozen: Mapping[int, Value],
    here: Mapping[int, Value],
    method: Method = VELDHUIZEN,
) -> Step:
    """A step of a system.

    Args:
        states: its states.
        size: size of the step h (s).
        frozen: values by id for the whole step, such as where it began.
        here: simpler values by id that hold at its beginning.
        method: the method.
    """
    values, rates = [s.value for s in states], [s.rate for s in states]
    jacobian = substituted(derivatives(rates, values), frozen)
    part = method.gamma * size
    solve = solver(jacobian, part)
    stages: list[list[Value]] = []
    slopes: list[Value] = []
    visited: list[list[Value]] = []
    for coefficients, couplings in zip(method.stages, method.couplings, strict=True):
        if coefficients is not None:
            moved = {
                value.id: total(value, coefficients, [stage[i] for stage in stages])
                for i, value in enumerate(values)
            }
            given = {**frozen, **moved} if coefficients else {**frozen, **here}
            slopes = substitute(rates, given)
            visited.append([moved[value.id] for value in values])
        factors = [(method.gamma * coupling) * (1.0 / part) for coupling in couplings]
        right = [
            total(slope, factors, [stage[i] for stage in stages]) for i, slope in enumerate(slopes)
        ]
        stages.append(solve([part * slope for slope in right]))
    across = [[stage[i] for stage in stages] for i in range(len(values))]
    return Step(
        states=[total(v, method.weights, u) for v, u in zip(values, across, strict=True)],
        errors=[total(None, method.errors, u) for u in across],
        visited=visited[1:],
    )
