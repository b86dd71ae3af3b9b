"""The dissertation's studies as functions: each printed table beside the same recomputed.

`compare_all` runs all of them; `tustin`, `position_voltage` and `voltage_profile` hold its
feed-forward, for the controllers too.
"""

from pma_gym.studies.comparison import VERDICTS, Comparison, Verdict

__all__ = ["VERDICTS", "Comparison", "Verdict", "compare_all"]


def compare_all() -> list[Comparison]:
    """Every figure of the dissertation that its own data can check, study by study."""
    # Here: controllers import a study, and need neither python-control nor scipy.stats for it.
    from pma_gym.studies.comparison import compare_conversions
    from pma_gym.studies.contraction import (
        compare_contraction,
        compare_profiles,
        compare_relaxation,
        compare_static_loading,
    )
    from pma_gym.studies.recursion import compare_recursion
    from pma_gym.studies.station_limits import compare_station_limits
    from pma_gym.studies.trials import compare_trials

    return [
        *compare_static_loading(),
        *compare_contraction(),
        *compare_relaxation(),
        *compare_profiles(),
        *compare_station_limits(),
        *compare_recursion(),
        *compare_trials(),
        *compare_conversions(),
    ]
