"""The parts of a diagnosis: data classes, and how each stands in `diagnosis.json`."""
