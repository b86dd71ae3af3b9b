"""Weights of the exponential Runge-Kutta step; called from generated code, so compiled with it."""

from pma_gym.effects.arithmetic import where

FAR = 80.0
"""Decay times step beyond which even exp(-z/2) is 0 beside 1 in double precision."""


def coefficients(decay: float, step: float) -> tuple[float, float, float, float, float, float]:
    """Weights of one exponential Runge-Kutta step of a state.

    The functions phi_k(z) = (phi_{k-1}(z) - 1/(k-1)!) / z at z = -decay * step come from Taylor
    series at z/64, doubled up; nothing cancels, and at decay = 0 the classical weights result.
    Far out, where exp(z) is nothing, they come from their definition.

    Args:
        decay: decay rate (1/s), not negative.
        step: h (s).
    Returns:
        exp(z/2), h/2 phi_1(z/2), exp(z), and h times phi_1 - 3 phi_2 + 4 phi_3,
        phi_2 - 2 phi_3, 4 phi_3 - phi_2 at z.
    Source:
        Cox and Matthews 2002, Eq. 26-29.
    """
    far = decay * step > FAR
    y = where(far, FAR, decay * step) * (-1.0 / 64.0)
    # 1 / 6 + y / 24 + y^2 / 120 + ..., by Horner; the reciprocals are constants, not divisions.
    phi3 = 1.0 + y * (1.0 / 9.0) * (1.0 + y * (1.0 / 10.0))
    phi3 = 1.0 + y * (1.0 / 7.0) * (1.0 + y * (1.0 / 8.0) * phi3)
    phi3 = 1.0 + y * (1.0 / 5.0) * (1.0 + y * (1.0 / 6.0) * phi3)
    phi3 = (1.0 + y * (1.0 / 4.0) * phi3) * (1.0 / 6.0)
    phi2 = 0.5 + y * phi3
    phi1 = 1.0 + y * phi2
    power = 1.0 + y * phi1
    for _ in range(5):
        phi3 = ((power + 1.0) * phi3 + phi2 + 0.5 * phi1) * 0.125
        phi2 = ((power + 1.0) * phi2 + phi1) * 0.25
        phi1 = (power + 1.0) * phi1 * 0.5
        power = power * power
    half_power, half_weight = power, 0.5 * step * phi1
    phi3 = ((power + 1.0) * phi3 + phi2 + 0.5 * phi1) * 0.125
    phi2 = ((power + 1.0) * phi2 + phi1) * 0.25
    phi1 = (power + 1.0) * phi1 * 0.5
    ratio = 1.0 / where(far, decay * step, 1.0)
    phi1 = where(far, ratio, phi1)
    phi2 = where(far, (1.0 - ratio) * ratio, phi2)
    phi3 = where(far, (0.5 - phi2) * ratio, phi3)
    return (
        half_power,
        where(far, step * ratio, half_weight),
        power * power,
        step * (phi1 - 3.0 * phi2 + 4.0 * phi3),
        step * (phi2 - 2.0 * phi3),
        step * (4.0 * phi3 - phi2),
    )
