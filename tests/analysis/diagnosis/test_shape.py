"""The shape that a law lacks, and injected effects: told, drawn and written only where there is something."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from analysis.diagnosis import figures, words
from analysis.diagnosis.answer import answer
from analysis.diagnosis.content import contract
from analysis.diagnosis.contract import write_diagnosis
from analysis.diagnosis.outcome import outcome_of
from analysis.diagnosis.shape import lacks
from idm_sumo.diagnosis import Detectable, Diagnosis, Gain, LawMisfit
from idm_sumo.diagnosis.law_misfit import Cell
from idm_sumo.models.effects import ExtendedModel
from idm_sumo.models.idm import TEXTBOOK

SLOW = Cell("speed", (3.0, 5.0), (12.0, 20.0), 0.4, 0.05, 17)
CLOSING = Cell("approach_rate", (0.5, 1.0), (12.0, 20.0), -0.9, 0.05, 30)
AROUND = Cell("approach_rate", (-0.3, 0.2), (12.0, 20.0), 0.01, 0.05, 30)


def found(misfit: LawMisfit | None) -> Diagnosis:
    """Return a diagnosis that names nothing."""
    model = ExtendedModel(TEXTBOOK, 30.0)
    gain = Gain("ade_m", 1.0, 1.0, 0.0, (0.0, 0.0), 20)
    table = pd.DataFrame({"position": [0.0, 600.0], "time": [0.0, 60.0], "speed": [5.0, 9.0], "window": [0, 1]})
    drivers = pd.DataFrame({"period": ["p"], "vehicle": [1], "windows": [2], "held_out": [True]})
    return Diagnosis(
        "none", (), (), (), gain, (), (), {}, model, model, table, drivers, (), {}, law_misfit=misfit,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ((SLOW, AROUND), "at 3.0 to 5.0 m/s, with gaps of 12 to 20 m, drivers accelerate more, or brake less, by 0.40"),
        ((SLOW, CLOSING), "closing in by 0.5 to 1.0 m/s, with gaps of 12 to 20 m, drivers accelerate less, or brake"),
        ((AROUND,), "falling back by less than 0.3 or closing in by less than 0.2 m/s"),
    ],
)  # fmt: skip
def test_the_surest_cell_is_told_and_no_cause_is_not_nothing(cells: tuple[Cell, ...], said: str) -> None:
    outcome = outcome_of(found(LawMisfit(0.2, 1e-9, cells)))
    assert said in lacks(outcome)
    screen = answer(outcome)
    assert screen.what.startswith("No effect of the catalogue was found, but the IDM lacks a shape: ")
    assert "nothing beyond" not in screen.what
    assert screen.advice[0].startswith("Expect errors there")


@pytest.mark.parametrize("misfit", [None, LawMisfit(0.0, 0.4, (SLOW,)), LawMisfit(0.1, 1e-9, ())])
def test_what_chance_makes_is_no_shape(misfit: LawMisfit | None) -> None:
    outcome = outcome_of(found(misfit))
    assert lacks(outcome) == ""
    assert answer(outcome).what == "No cause was found: these data show nothing beyond the IDM."


def test_cells_are_drawn_over_speed_and_over_approach_rate_and_written(tmp_path: Path) -> None:
    misfit = LawMisfit(0.2, 1e-9, (SLOW, CLOSING, AROUND))
    panels = figures.law_misfit(misfit).axes[:2]
    assert [len(panel.collections[0].get_array()) for panel in panels] == [1, 2]
    assert misfit.table["acceleration_m_s2"].tolist() == [0.4, -0.9, 0.01]
    content = contract(found(misfit))
    assert content["law_misfit"]["surest"]["gap_m"] == [12.0, 20.0]
    assert content["law_misfit"]["surest"]["x_name"] == "approach_rate"
    write_diagnosis(tmp_path / "diagnosis.json", content)
    assert contract(found(None))["law_misfit"] is None


def test_injections_are_counted_by_size_and_written_as_shares() -> None:
    each = (
        Detectable("reaction_delay", "tau", "s", 0.2, 3, 10),
        Detectable("reaction_delay", "tau", "s", 0.4, 9, 10),
        Detectable("location", "alpha", "m/s^2", -0.12, 10, 10),
    )
    diagnosis = replace(found(None), detectable=each)
    assert words.detectable_sentences(diagnosis) == [
        "reaction delay, injected into these very drivers (tau): of 0.2 s in 3 of 10, of 0.4 s in 9 of 10",
        "location, injected into these very drivers (alpha): of -0.12 m/s^2 in 10 of 10",
    ]
    written = contract(diagnosis)["detectable"]
    assert written[1] == {"name": "reaction_delay", "symbol": "tau", "unit": "s", "size": 0.4, "found": 0.9, "of": 10}
    assert words.detectable_sentences(found(None)) == []
