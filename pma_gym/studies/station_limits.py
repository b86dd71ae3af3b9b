"""Limits of the station: tables 17 and 18 out of table I3 (section 5.2.1)."""

import numpy as np
from numpy.typing import NDArray

from pma_gym.data.serres2008 import Table, load_table
from pma_gym.studies.comparison import (
    Comparison,
    compare,
    compare_computed,
    half_units,
    rounding_reach,
)
from pma_gym.studies.voltage_profile import Quadratic, printed_quadratics, used_quadratics

STUDY = "station limits"


def _fit(voltage: NDArray[np.float64], extension: NDArray[np.float64]) -> list[float]:
    coefficients = np.polyfit(voltage, extension, 2)
    residual = extension - np.polyval(coefficients, voltage)
    spread = extension - np.mean(extension)
    return [*map(float, coefficients), 1.0 - float(residual @ residual) / float(spread @ spread)]


def compare_station_limits() -> list[Comparison]:
    """Tables 17, 18 and 23 and the text's figures beside table I3."""
    return _compare_table_17() + _compare_table_18() + _compare_text() + _compare_moments()


def _at_load(pressure: str, load: float = 900.0) -> Table:
    return load_table("I3").where(pressure_nominal_kpa=float(pressure), load_nominal_n=load)


def _compare_table_17() -> list[Comparison]:
    printed = load_table("17").printed
    names = ("no_load_contraction_mm", "extension_mm", "extension_percent")
    rows: list[Comparison] = []
    for row, pressure in enumerate(printed["pressure_kpa"]):
        cells = _at_load(pressure).printed
        rows += compare_computed(
            (STUDY, "17"),
            [f"{pressure} kPa {name}" for name in names],
            [printed[name][row] for name in names],
            _means_at_load,
            [*cells["no_load_contraction_mm"], *cells["extension_mm"]],
            "mean of three repeats at 900 N",
        )
    return rows


def _means_at_load(inputs: NDArray[np.float64]) -> list[float]:
    contraction, extension = inputs[:3].mean(), inputs[3:].mean()
    return [contraction, extension, 100.0 * extension / contraction]


def _compare_table_18() -> list[Comparison]:
    printed = load_table("18").printed
    names = ("v2_m_per_v2", "v1_m_per_v", "v0_m", "r_squared")
    rows: list[Comparison] = []
    for row, pressure in enumerate(printed["pressure_kpa"]):
        data = load_table("I3").where(pressure_nominal_kpa=float(pressure))
        voltage = data["motor_voltage_v"]

        def compute(extension_mm: NDArray, voltage: NDArray = voltage) -> list[float]:
            return _fit(voltage, 1e-3 * extension_mm)

        extension = data["extension_mm"]
        reach = rounding_reach(compute, extension, half_units(data.printed["extension_mm"]))
        labels = [f"{pressure} kPa {name}" for name in names]
        texts = [printed[name][row] for name in names]
        rows += compare(
            (STUDY, "18"),
            labels,
            texts,
            compute(extension),
            reach,
            "least squares over 36 rows of table I3",
        )
    return rows + _compare_used_quadratics()


def _compare_used_quadratics() -> list[Comparison]:
    """The profiles of 250 kPa were computed with other coefficients than table 18 prints."""
    printed = load_table("18").printed
    used = used_quadratics()
    rows: list[Comparison] = []
    for pressure, quadratic in printed_quadratics().items():
        if quadratic != used[pressure]:
            row = printed["pressure_kpa"].index(str(pressure))
            labels = [f"{pressure} kPa {name} as used in table I6" for name in Quadratic._fields]
            texts = [printed[name][row] for name in ("v2_m_per_v2", "v1_m_per_v", "v0_m")]
            rows += compare(
                ("voltage profiles", "18"),
                labels,
                texts,
                list(used[pressure]),
                note="recovered from table I6; table 18 prints the fit of table I3",
            )
    return rows


def _compare_text() -> list[Comparison]:
    text = load_table("text").where(section="5.2.1").printed
    values: list[float] = []
    for pressure in ("150", "550"):
        data = load_table("I3").where(pressure_nominal_kpa=float(pressure))
        values.append(float(data["no_load_contraction_mm"].mean()))
    for pressure in ("150", "550"):
        cells = _at_load(pressure)
        inputs = np.concatenate([cells["no_load_contraction_mm"], cells["extension_mm"]])
        values.append(_means_at_load(inputs)[2])
    return compare(
        (STUDY, "text"),
        text["quantity"],
        text["printed"],
        values,
        note="contraction: mean of 36 rows of table I3; percent: of the three at 900 N",
    )


def load_at_rotation(pressure_kpa: float, rotation_deg: float = 90.0) -> float:
    """Load (N) at which the mean rotation of table I3's repeats reaches an angle.

    Linear between the twelve loads; a lost figure is left out of its mean.

    Args:
        pressure_kpa: one of table I3's eleven.
        rotation_deg: within the measured rotations.
    """
    data = load_table("I3").where(pressure_nominal_kpa=pressure_kpa)
    at_load = [data.where(load_nominal_n=load) for load in np.unique(data["load_nominal_n"])]
    rotation = [float(np.nanmean(rows["rotation_deg"])) for rows in at_load]
    measured = [float(rows["load_n"].mean()) for rows in at_load]
    return float(np.interp(rotation_deg, rotation, measured))


def _compare_moments() -> list[Comparison]:
    """Table 23 beside load times pulley radius: no one radius gives it."""
    printed = load_table("23").printed
    rows: list[Comparison] = []
    for pressure, moment in zip(printed["pressure_kpa"], printed["moment_nm"], strict=True):
        load = load_at_rotation(float(pressure))
        radius_mm = 1e3 * float(moment) / load
        name = f"{pressure} kPa moment (N m)"
        rows += compare(
            (STUDY, "23"),
            [name],
            [moment],
            [25.4e-3 * load],
            note=f"load at 90 deg x 25.4 mm; the printed moment would need {radius_mm:.1f} mm",
        )
    return rows
