"""What notebooks show of trials, comparisons, models, plants and scores."""

from html.parser import HTMLParser

import numpy as np
import pytest

from pma_gym import Plant, Trial, compare, load_model
from pma_gym.studies.evaluation import evaluate

TIME = np.arange(1923) / 384.0
ASKED = Trial(
    TIME,
    {"motor_voltage": 0.9 * TIME, "pressure_command": np.full(TIME.size, 3e5)},
    provenance={"note": "<script>alert(1)</script>"},
)


class Page(HTMLParser):
    """Tags that are open, and how many of each there were."""

    VOID = ("img", "br", "meta")

    def __init__(self, text):
        super().__init__()
        self.open, self.seen, self.text = [], {}, []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.seen[tag] = self.seen.get(tag, 0) + 1
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data.strip())


@pytest.fixture(scope="module")
def objects():
    plant = Plant("serres2008")
    trial = plant.simulate(ASKED, noise=False)
    return {
        "trial": trial,
        "comparison": compare(trial, plant.simulate(ASKED, seed=1)),
        "plant": plant,
        "model": load_model("serres2008"),
        "score": evaluate(trial),
    }


@pytest.mark.parametrize("name", ["trial", "comparison", "plant", "model", "score"])
def test_it_is_html_that_closes_all_it_opens(objects, name):
    page = Page(objects[name]._repr_html_())
    assert page.open == []
    assert "script" not in page.seen
    assert page.seen.get("img", 0) == (1 if name in ("trial", "comparison") else 0)


def test_a_models_table_has_every_parameter(objects):
    model = objects["model"]
    page = Page(model._repr_html_())
    assert page.seen["tr"] == 1 + len(list(model.paths()))
    slope = {row[:2]: row for row in model.rows()}["contractile_force", "slope"]
    assert slope.value_text in page.text and slope.unit in page.text


def test_a_plant_names_its_states(objects):
    text = " ".join(Page(objects["plant"]._repr_html_()).text)
    assert all(state in text for state in objects["plant"].states)


def test_a_score_shows_its_figures(objects):
    (row,) = objects["score"]
    page = Page(objects["score"]._repr_html_())
    assert f"{row.rmse * 1e3:.6g}" in page.text
    (document,) = objects["score"].documents()
    assert document["rmse_mm"] == pytest.approx(row.rmse * 1e3)
    assert document["slope_mm_per_s"] == pytest.approx(row.regression.slope * 1e3)
