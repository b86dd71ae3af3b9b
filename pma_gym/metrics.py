"""Metrics of trials: RMSE, percent of range, and regression lines.

One definition for measured, simulated and controlled trials alike. Nothing here knows a unit:
values in m give slopes in m/s and squares in m^2, values in deg give deg/s and deg^2.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

SAMPLE_RATE_HZ = 384.0
"""Rate at which the dissertation's trials were logged and every trial is scored (Hz)."""

PHASE_SAMPLES = 1923
"""Samples in one phase of a trial (Serres 2008, tables 20, 24-26: 1922 degrees of freedom)."""

PHASE_DURATION = 5.0
"""Time from the start of one phase to the start of the next (s)."""


def phase_times(phase: int = 0) -> NDArray[np.float64]:
    """Return the times at which a phase is scored, from the start of the trial.

    The 1923 samples outlast the 5 s by two, so phases overlap by 5 ms. The standard errors of
    tables 21 and 27-29 give the same rate and number but a mean time of 2.5000 s: there, each
    phase's time began one sample before 0, which moves an intercept by slope / 384 s.

    Args:
        phase: 0 for the first; `phase_times(0)` is also every phase's own time.
    Returns:
        Times (s), shape (1923,), 1/384 s apart, from 5 * phase on.
    """
    return PHASE_DURATION * phase + np.arange(PHASE_SAMPLES) / SAMPLE_RATE_HZ


def rmse(error: ArrayLike) -> float:
    """Compute the root mean square of an error over all samples.

    Args:
        error: actual minus ideal, any shape.
    Returns:
        The RMSE, in the error's unit.
    Raises:
        ValueError: there is no sample, or one is NaN or infinite.
    """
    values = _finite("error", error)
    return math.sqrt(float(np.mean(np.square(values))))


def percent_of_range(rmse: float, span: float) -> float:
    """Express an RMSE as a percentage of the task's range.

    >>> percent_of_range(1.92, 25)  # table 22, 150 kPa
    7.68
    """
    return 100.0 * rmse / span


@dataclass(frozen=True)
class Regression:
    """Least-squares line through one phase of a trial, with its analysis of variance.

        value = intercept + slope * time

    Attributes:
        n: number of samples.
        slope: (unit/s).
        intercept: value of the line at the phase's own time 0 (unit).
        ss_error: sum of the squared residuals (unit^2).
        time_mean: mean of the times (s).
        time_ss: sum of squares of the times about their mean (s^2).
    Source:
        Serres 2008, tables 20-21 and 24-29: one row each.
    """

    n: int
    slope: float
    intercept: float
    ss_error: float
    time_mean: float
    time_ss: float

    @property
    def error_dof(self) -> int:
        """Degrees of freedom of the error: n - 2."""
        return self.n - 2

    @property
    def residual_mean_square(self) -> float:
        """Mean square of the error: ss_error / (n - 2) (unit^2)."""
        return _ratio(self.ss_error, self.error_dof)

    @property
    def scatter(self) -> float:
        """Root mean square of the values about the line (unit); no degree of freedom is counted."""
        return math.sqrt(self.ss_error / self.n)

    @property
    def ss_model(self) -> float:
        """Sum of squares of the model: slope^2 * time_ss (unit^2)."""
        return self.slope**2 * self.time_ss

    @property
    def ss_total(self) -> float:
        """Sum of squares of the values about their mean (unit^2)."""
        return self.ss_model + self.ss_error

    @property
    def f_ratio(self) -> float:
        """F ratio of the model; infinite for a perfect line."""
        return _ratio(self.ss_model, self.residual_mean_square)

    @property
    def r_squared(self) -> float:
        """Share of the variance that the line explains; NaN for values that never change."""
        return _ratio(self.ss_model, self.ss_total)

    @property
    def slope_std_error(self) -> float:
        """Standard error of the slope (unit/s)."""
        return math.sqrt(self.residual_mean_square / self.time_ss)

    @property
    def intercept_std_error(self) -> float:
        """Standard error of the intercept (unit)."""
        weight = 1.0 / self.n + self.time_mean**2 / self.time_ss
        return math.sqrt(self.residual_mean_square * weight)

    @property
    def slope_t_ratio(self) -> float:
        """Slope over its standard error; infinite for a perfect line."""
        return _ratio(self.slope, self.slope_std_error)

    @property
    def intercept_t_ratio(self) -> float:
        """Intercept over its standard error; infinite for a perfect line."""
        return _ratio(self.intercept, self.intercept_std_error)


def regression(time: ArrayLike, values: ArrayLike) -> Regression:
    """Fit a least-squares line to values over time.

    Args:
        time: the phase's own time (s), shape (n,), n >= 3, not all equal.
        values: what was measured then, shape (n,).
    Returns:
        The line and its sums of squares.
    Raises:
        ValueError: shapes differ, fewer than three samples, NaN or infinity, or a single time.
    """
    times, measured = _finite("time", time), _finite("values", values)
    if times.ndim != 1 or times.shape != measured.shape:
        raise ValueError(
            "time and values must be one-dimensional and equally long, "
            f"got shapes {times.shape} and {measured.shape}"
        )
    if times.size < 3:
        raise ValueError(f"a regression needs at least 3 samples, got {times.size}")
    mean, level = float(np.mean(times)), float(np.mean(measured))
    centred = times - mean
    spread = float(centred @ centred)
    if spread == 0.0:
        raise ValueError(f"a regression needs different times, all are {mean:g} s")
    slope = float(centred @ (measured - level)) / spread
    residuals = measured - level - slope * centred
    ss_error = float(residuals @ residuals)
    return Regression(times.size, slope, level - slope * mean, ss_error, mean, spread)


def rmse_from_regression(
    line: Regression, ideal_slope: float, ideal_intercept: float = 0.0
) -> float:
    """Compute a trial's RMSE against a straight ideal from its regression.

        RMSE^2 = ss_error / n + mean of (intercept error + slope error * time)^2

    An identity, for the residuals of a least-squares line are orthogonal to every other line. It
    ties tables 20-22 and 24-30 together: in all 33 cases it gives the printed RMSE within 0.011.

    Args:
        line: the trial's regression.
        ideal_slope: slope of the ideal (unit/s).
        ideal_intercept: value of the ideal at the phase's own time 0 (unit).
    Returns:
        The RMSE (unit).
    """
    return math.sqrt(line.ss_error / line.n + _line_mean_square(line, ideal_slope, ideal_intercept))


def line_error(line: Regression, ideal_slope: float, ideal_intercept: float = 0.0) -> float:
    """Compute the line part of a trial's RMSE: rms of regression line less ideal.

        RMSE^2 = line_error^2 + scatter^2

    A bias of the line can no longer make up for a scatter that is missing, as it can in the RMSE.

    Args:
        line: the trial's regression; `Regression.scatter` is the other part.
        ideal_slope: slope of the ideal (unit/s).
        ideal_intercept: value of the ideal at the phase's own time 0 (unit).
    Returns:
        Root mean square over the trial (unit).
    """
    return math.sqrt(_line_mean_square(line, ideal_slope, ideal_intercept))


def _line_mean_square(line: Regression, ideal_slope: float, ideal_intercept: float) -> float:
    """Mean square over the trial of its regression line less an ideal one (unit^2)."""
    slope_error = line.slope - ideal_slope
    middle = line.intercept - ideal_intercept + slope_error * line.time_mean
    return middle**2 + slope_error**2 * line.time_ss / line.n


def _finite(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """The values as floats; refuses none at all, NaN and infinity."""
    array = np.asarray(values, dtype=np.float64)
    if array.size == 0:
        raise ValueError(f"{name} has no samples")
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        raise ValueError(
            f"{name} must be finite, sample {bad[0]} is {array.flat[bad[0]]}; "
            "leave out samples that were not measured"
        )
    return array


def _ratio(numerator: float, denominator: float) -> float:
    """Quotient with the limits of a perfect fit: x/0 is infinite with x's sign, 0/0 is NaN."""
    if denominator:
        return numerator / denominator
    return math.copysign(math.inf, numerator) if numerator else math.nan
