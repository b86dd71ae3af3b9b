"""The cascade's transfer function as a recursion in time, and its inverse."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import control


class Recursion(NamedTuple):
    """Coefficients of the recursion, in the dissertation's order.

        y(t) = - a y(t-2) - b y(t-1) + c x(t-2) + d x(t-1) + e x(t)

    Source:
        Serres 2008, Eq. 24.
    """

    a: float
    b: float
    c: float
    d: float
    e: float


def cascade_transfer(
    muscle_rate: float, motor_rate: float, gain: float = 1.0
) -> "control.TransferFunction":
    """Motor and muscle in cascade, from wanted input to position.

        Y / X = gain A B / ((s + A) (s + B))

    Args:
        muscle_rate: A = K / B_PMA of the muscle (1/s).
        motor_rate: B = F_M r / B_M of the motor (1/s).
        gain: G.

    Source:
        Serres 2008, Eq. 22; the motor's inertia is left out there.
    """
    # Here: it brings matplotlib along, which takes half a second.
    import control

    denominator = np.polymul([1.0, muscle_rate], [1.0, motor_rate])
    return control.TransferFunction(
        [gain * muscle_rate * motor_rate],
        denominator,
        inputs="x_input",
        outputs="y",
        name="cascade",
    )


def tustin_recursion(transfer: "control.TransferFunction", sample_time: float) -> Recursion:
    """The recursion of a second-order transfer function by Tustin's method.

    Args:
        transfer: continuous, with one input and one output and two poles.
        sample_time: T (s).

    Source:
        Serres 2008, section 4.2.1.
    """
    sampled = transfer.sample(sample_time, method="tustin")
    e, d, c = sampled.num[0][0]
    _, b, a = sampled.den[0][0]
    return Recursion(*(float(value) for value in (a, b, c, d, e)))


def closed_form_recursion(
    muscle_rate: float, motor_rate: float, sample_time: float, gain: float = 1.0
) -> Recursion:
    """The recursion of the cascade as the dissertation writes it out.

    Args:
        muscle_rate: A (1/s).
        motor_rate: B (1/s).
        sample_time: T (s).
        gain: G.

    Source:
        Serres 2008, Eq. 25. Its Appendix C ends with the other sign of 2 (A + B) T: see
        `appendix_c_recursion`.
    """
    product = muscle_rate * motor_rate * sample_time**2
    total = 2.0 * (muscle_rate + motor_rate) * sample_time
    scale = product + total + 4.0
    forward = gain * product / scale
    return Recursion(
        a=(product - total + 4.0) / scale,
        b=(2.0 * product - 8.0) / scale,
        c=forward,
        d=2.0 * forward,
        e=forward,
    )


def appendix_c_recursion(
    muscle_rate: float, motor_rate: float, sample_time: float, gain: float = 1.0
) -> Recursion:
    """The recursion as Appendix C prints it: wrong, its poles lie outside the unit circle.

    The sign of 2 (A + B) T is swapped, which puts each pole at the inverse of the right one.
    Kept to show the error; everything else uses `tustin_recursion`.

    Source:
        Serres 2008, Appendix C.
    """
    return closed_form_recursion(-muscle_rate, -motor_rate, sample_time, gain)


def poles(recursion: Recursion) -> NDArray[np.complex128]:
    """Poles of the recursion, shape (2,); it is stable if all lie inside the unit circle."""
    return np.roots([1.0, recursion.b, recursion.a]).astype(np.complex128)


def inverse_recursion(reference: ArrayLike, recursion: Recursion) -> NDArray[np.float64]:
    """Input whose recursion gives the reference, everything zero before the first sample.

        x(t) = (y(t) + b y(t-1) + a y(t-2) - d x(t-1) - c x(t-2)) / e

    Tustin's method puts both zeros of the recursion at z = -1, where the inverse has a double
    pole: a reference that starts to move at speed v leaves an oscillation from sample to sample
    that never decays and grows by 4 v / (A B T) a sample. At the dissertation's T = 0.2 s that is
    the chatter of its voltage profiles; at T = 0.01 s it is some mm within seconds.

    Args:
        reference: wanted position at the sample times, shape (n,).
        recursion: coefficients for the sample time.

    Source:
        Serres 2008, section 5.2.1 and tables I4-I20.
    """
    from scipy.signal import lfilter

    return np.asarray(
        lfilter(
            [1.0, recursion.b, recursion.a],
            [recursion.e, recursion.d, recursion.c],
            np.asarray(reference),
        )
    )
