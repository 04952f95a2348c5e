"""Candidates: the best stretch of place or time, and the one beside it that may be meant as well."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.atoms import SECANT_ATOMS, Atom
from idm_sumo.diagnosis.evidence import Evidence
from idm_sumo.effects import slots

BINS, WIDTH, DRIVERS = 40, 16.0, 30


def evidence(effect: np.ndarray, absorbed: float, seed: int = 0) -> Evidence:
    """Return what is seen of a shift by bin, if drivers take up ``absorbed`` of what is the same everywhere."""
    rng = np.random.default_rng(seed)
    gram = 40.0 * (np.eye(BINS) - absorbed / BINS)
    noise = rng.multivariate_normal(np.zeros(BINS), gram, DRIVERS) / np.sqrt(DRIVERS)
    u = (gram @ effect) / DRIVERS + noise
    atoms = [Atom("location", low=WIDTH * n, high=WIDTH * (n + 1)) for n in range(BINS)]
    part = np.tile(np.diag(gram) / DRIVERS, (DRIVERS, 1))
    twins = rng.multivariate_normal(np.zeros(BINS), gram / 9.0, 3)
    return Evidence(atoms, u, twins, gram, part, np.arange(DRIVERS))


def place(low: int, high: int, shift: float) -> np.ndarray:
    out = np.zeros(BINS)
    out[low:high] = shift
    return out


def test_the_place_that_was_shifted_is_found():
    found = hy.candidates(evidence(place(10, 20, -1.0), 0.0))[0]
    assert (found.name, found.atom.low, found.atom.high) == ("location", 10 * WIDTH, 20 * WIDTH)
    assert found.value == pytest.approx(-1.0, abs=4 * found.error)
    assert found.p < 1e-6
    assert dict(hy.slots_of(found))[slots.PLACE_BEGIN] == 10 * WIDTH


def test_where_less_is_done_at_a_place_more_is_done_beside_it():
    seen = evidence(place(20, 40, -1.0), 1.0)
    best = hy.candidates(seen)[0]
    both = hy.forms(seen, best)
    assert both[0] == best
    assert len(both) == 2
    assert both[0].value * both[1].value < 0.0
    assert sorted([one.atom.low for one in both]) == pytest.approx([0.0, 20 * WIDTH], abs=WIDTH)


def test_a_place_that_stands_alone_has_one_form():
    seen = evidence(place(10, 20, -1.0), 0.0)
    assert len(hy.forms(seen, hy.candidates(seen)[0])) == 1


def test_every_recovery_of_a_relaxation_is_as_sure_as_the_surest():
    atoms = [atom for atom in SECANT_ATOMS if atom.name == "lane_change_relaxation"]
    gram, best = np.diag([40.0, 60.0, 50.0]), np.array([0.1, 0.6, 0.3])
    u = np.tile(gram @ best / DRIVERS, (DRIVERS, 1)) + np.random.default_rng(0).standard_normal((DRIVERS, 3)) * 0.1
    seen = Evidence(
        atoms, u, np.zeros((3, 3)), gram, np.tile(np.diag(gram) / DRIVERS, (DRIVERS, 1)), np.arange(DRIVERS)
    )
    surest = hy.candidates(seen)[0]
    forms = hy.forms(seen, surest)
    assert [form.atom.fixed for form in forms] == [atom.fixed for atom in atoms]
    assert {(form.z, form.p) for form in forms} == {(surest.z, surest.p)}
    assert forms[0].value < forms[2].value < forms[1].value
