"""The shape that a law lacks: found where it was put, nothing where the law is right, and only where drivers were."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.diagnosis import columns as co
from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import law
from idm_sumo.diagnosis import selection as se
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.chance import Noises, draws
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.law_misfit import FORMS, FormEvidence, law_misfit
from idm_sumo.diagnosis.library import library_of
from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.replicates import make_replicate
from idm_sumo.diagnosis.search import Look
from idm_sumo.diagnosis.settings import SETTINGS
from idm_sumo.models import laws
from tests.helpers.followers import followers

PIVOT = 9.0
JITTER = Noises(Noise(1e-4, np.zeros(0), np.zeros(0)), Noise(0.0, np.zeros(0), np.zeros(0)))


def windows_of(number: int = laws.IDM) -> w.Windows:
    return followers(law.of(number), np.random.default_rng(1))[0]


def information(rng: np.random.Generator) -> np.ndarray:
    columns = rng.standard_normal((400, FORMS)) * rng.uniform(5.0, 30.0, FORMS)
    return columns.T @ columns


def test_a_planted_shape_comes_back_with_its_size() -> None:
    rng, windows = np.random.default_rng(2), windows_of()
    for tau in (0.02, 0.1, 0.4):
        gram = information(rng)
        planted = tau * rng.standard_normal(FORMS)
        score = gram @ planted + np.linalg.cholesky(gram) @ rng.standard_normal(FORMS)
        found = law_misfit(windows, FormEvidence(score, gram), PIVOT)
        assert tau / 2.5 < found.typical_m_s2 < 2.5 * tau
        assert found.p_value < 1e-6
        assert found.surest is not None
        assert abs(found.surest.acceleration) > 3.0 * found.surest.standard_error


def test_of_a_law_that_lacks_nothing_p_values_are_uniform() -> None:
    rng, windows = np.random.default_rng(3), windows_of().of_rows(np.arange(9))
    values = []
    for _ in range(200):
        gram = information(rng)
        score = np.linalg.cholesky(gram) @ rng.standard_normal(FORMS)
        values.append(law_misfit(windows, FormEvidence(score, gram), PIVOT).p_value)
    fifths = np.histogram(values, bins=5, range=(0.0, 1.0))[0]  # 40 each, 5.7 standard deviation
    assert fifths.min() > 17
    assert fifths.max() < 63


def test_only_cells_in_which_five_drivers_were_are_told() -> None:
    rng, windows = np.random.default_rng(4), windows_of()
    gram = information(rng)
    few = windows.of_drivers(np.arange(4))
    evidence = FormEvidence(gram @ np.full(FORMS, 0.1), gram)
    assert law_misfit(few, evidence, PIVOT).cells == ()
    assert law_misfit(few, evidence, PIVOT).surest is None
    cells = law_misfit(windows, evidence, PIVOT).cells
    assert cells
    assert all(cell.drivers >= 5 for cell in cells)
    gap = windows.seen[:, w.REAR, w.LEAD + w.EVERY :: w.EVERY] - windows.seen[:, w.X, w.LEAD + w.EVERY :: w.EVERY]
    assert min(cell.gap_m[0] for cell in cells) >= gap.min()
    assert max(cell.gap_m[1] for cell in cells) <= gap.max()


@pytest.mark.parametrize(("number", "lacks"), [(laws.IDM, False), (laws.FULL_VELOCITY_DIFFERENCE, True)])
def test_an_idm_lacks_what_drivers_of_another_law_do(number: int, *, lacks: bool) -> None:
    smooth = windows_of(number)
    one, *chances = draws(smooth, JITTER, 5, np.random.default_rng(0))
    windows = make_replicate(smooth, fit_drivers(smooth, law.of(number), np.full(2, 1e-4)), one, is_smooth=True)
    subject = ev.Subject(windows, JITTER, True)
    fit = fit_drivers(windows, law.of(laws.IDM), np.full(2, 1e-4))
    plan = co.plan_of(windows, fit, free=False)
    evidence = ev.examine(subject, fit, plan, chances)
    library = library_of(plan, SETTINGS)
    arena = se.Competition(evidence, library, SETTINGS, evidence.score, 0.0)
    nothing = se.Selection((), 0.0, arena, np.zeros(plan.count), 0.0)
    look = Look(fit, (), evidence, library, evidence.score, nothing, SETTINGS)
    found = law_misfit(windows, look.of_form, plan.speed)
    assert (found.p_value < 1e-3) is lacks
