"""The tables of the dissertation behind the models, misprints corrected on loading.

Source:
    J. L. Serres, "Dynamic Characterization of a Pneumatic Muscle Actuator and Its Application to
    a Resistive Training Device", PhD dissertation, Wright State University, 2008.
"""

from pma_gym.data.serres2008.corrections import Correction, corrections
from pma_gym.data.serres2008.tables import Table, load_table, pressures, table_names

__all__ = ["Correction", "Table", "corrections", "load_table", "pressures", "table_names"]
