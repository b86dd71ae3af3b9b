"""A diagnosis that takes no time, in a module that another process reads quickly."""

from benchmarks.hidden_effects.evaluation.answers import Answer


def document(verdict="agrees", *effects):
    """A `diagnosis.json` with what a record keeps."""
    return {
        "verdict": verdict,
        "sentence": f"{verdict}.",
        "effects": [
            {"name": n, "confused_with": [], "p_value": 0.001, "parameters": p} for n, p in effects
        ],
        "parameters": {},
        "gap": {},
        "not_identifiable": {},
        "warnings": [],
        "blind": [],
        "candidates": [],
        "tones": {},
        "nuisances": [],
    }


def by_size(folder):
    """A diagnosis that needs no time: what it says depends on the trials' bytes alone."""
    text = (folder / "trial_01.csv").read_text("utf-8")
    if sum(map(ord, text)) % 2:
        raise ValueError("an odd file")
    return Answer(document("effect", ("creep", {})))
