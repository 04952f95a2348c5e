"""The competition: what is hidden in scores wins, and nothing wins where nothing is hidden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import free_fields as ff
from idm_sumo.diagnosis import plan as pl
from idm_sumo.diagnosis import selection as se
from idm_sumo.diagnosis.evidence import Evidence
from idm_sumo.diagnosis.library import library_of
from idm_sumo.diagnosis.search import Look, Trial
from idm_sumo.diagnosis.settings import SETTINGS
from idm_sumo.models.effects import BY_NAME

DRIVERS, INFORMATION, BINS = 120, 400.0, 20
PLACES = pl.Axis("position", np.linspace(0.0, 16.0 * BINS, BINS + 1))


def plan() -> pl.Plan:
    """Return columns of four effects, of which one is a place, of a free field and of the law's misfit."""
    names = ("reaction_delay", "hysteresis", "acceleration_asymmetry")
    groups = [pl.Group(pl.MISFIT), *(pl.Group(name, BY_NAME[name].forms[0]) for name in names)]
    groups.append(pl.Group("location", BY_NAME["location"].forms[0], axes=(PLACES,)))
    groups.append(pl.Group("", content=ff.DELAY, axes=(PLACES,)))
    begins = np.cumsum([0, *(group.count for group in groups)])
    numbered = tuple(replace(g, first=int(n)) for g, n in zip(groups, begins, strict=False))
    return pl.Plan(numbered, 10.0, (1,), (0.0, 300.0))


PLAN = plan()
LIBRARY = library_of(PLAN, SETTINGS)


def evidence(sizes: np.ndarray, seed: int, who: np.ndarray | None = None) -> Evidence:
    """Return scores of drivers who have effects of these sizes, one a column; ``who`` of them only."""
    rng = np.random.default_rng(seed)
    mixed = rng.normal(size=(PLAN.count, PLAN.count)) * 0.15 + np.eye(PLAN.count)
    gram = INFORMATION * mixed.T @ mixed / 1.3
    each = gram / DRIVERS
    noise = rng.multivariate_normal(np.zeros(PLAN.count), each, DRIVERS, method="eigh")
    has = np.ones(DRIVERS) if who is None else who * DRIVERS / who.sum()
    part = np.tile(np.diag(each), (DRIVERS, 1))
    nulls = rng.multivariate_normal(np.zeros(PLAN.count), gram / 16.0, 4, method="eigh")
    return Evidence(
        PLAN,
        has[:, None] * (each @ sizes) + noise,
        nulls,
        gram,
        part,
        np.arange(DRIVERS) // 4,
        np.full(DRIVERS, 1.0 / DRIVERS),
        np.full(PLAN.count, np.inf),
    )


def look(sizes: np.ndarray, seed: int, who: np.ndarray | None = None) -> Look:
    seen = evidence(sizes, seed, who)
    selection = se.compete(seen, LIBRARY, SETTINGS, seen.score)
    return Look(None, (), seen, LIBRARY, seen.score, selection, SETTINGS)  # type: ignore[arg-type]


def hidden(**effects: float) -> np.ndarray:
    """Return the sizes of columns; of a location in bins 5 to 10."""
    sizes = np.zeros(PLAN.count)
    for name, value in effects.items():
        columns = PLAN.of(name)
        sizes[columns[5:10] if name == "location" else columns] = value
    return sizes


def winners(seen: Look) -> list[str]:
    """Return the families that win, strongest first, each once."""
    found = [seen.winner(one) for one in seen.selection.components]
    names = [LIBRARY.names[LIBRARY.family[n]] for n in found if n is not None]
    return list(dict.fromkeys(names))


@pytest.mark.parametrize("prior", ["within", "prior"])
def test_priors_sum_to_one(prior):
    if prior == "prior":
        assert LIBRARY.prior.sum() == pytest.approx(1.0)
        assert LIBRARY.prior[[name not in BY_NAME for name in LIBRARY.names]].sum() == pytest.approx(SETTINGS.free)
    else:
        np.testing.assert_allclose(np.bincount(LIBRARY.family, LIBRARY.within), 1.0)


def test_nothing_wins_where_nothing_is_hidden():
    silent = [not winners(look(np.zeros(PLAN.count), seed)) for seed in range(12)]
    assert sum(silent) >= 11  # the stated rate of false alarms is two in a hundred


@pytest.mark.parametrize(
    ("name", "size"),
    [("reaction_delay", 0.4), ("hysteresis", 0.25), ("acceleration_asymmetry", -0.4), ("location", 0.25)],
)
def test_what_is_hidden_wins(name, size):
    assert winners(look(hidden(**{name: size}), 3))[:1] == [name]


def test_what_does_not_win_where_it_is_in_the_model_does_not_enter():
    around, before = look(hidden(hysteresis=0.25), 3), look(hidden(hysteresis=0.25, location=0.25), 3)
    less = before.selection.unexplained - around.selection.unexplained
    assert Trial(around, before, "location", 50.0).better == -np.inf
    assert Trial(around, before, "hysteresis", 50.0).better == pytest.approx(0.5 * (50.0 + less))
    assert Trial(around, before).better == less > 0.0


def test_of_two_both_win():
    assert set(winners(look(hidden(reaction_delay=0.5, location=-0.3), 4))) == {"reaction_delay", "location"}


def test_what_physics_forbids_does_not_win():
    assert "reaction_delay" not in winners(look(hidden(reaction_delay=-0.4), 5))


def test_a_place_is_found_where_it_is():
    seen = look(hidden(location=0.3), 6)
    winner = seen.winner(seen.selection.components[0])
    assert winner is not None
    low, high = LIBRARY.edges(winner)["position"]
    assert (low, high) == pytest.approx((80.0, 160.0), abs=16.0)


@pytest.mark.parametrize(("some", "least", "most"), [(DRIVERS, 60.0, DRIVERS), (1, 1.0, 3.0)])
def test_one_driver_counts_as_one(some, least, most):
    who = (np.arange(DRIVERS) < some).astype(float)
    seen = look(hidden(hysteresis=0.5), 7, who)
    number = int(np.flatnonzero(LIBRARY.family == LIBRARY.names.index("hysteresis"))[0])
    assert least <= seen.effective_drivers(number) <= most


def test_a_bayes_factor_is_that_of_two_normal_distributions():
    arena = se.Competition(
        evidence(hidden(hysteresis=0.2), 8), LIBRARY, SETTINGS, evidence(hidden(hysteresis=0.2), 8).score, 0.0
    )
    one = arena.component(np.zeros(PLAN.count))
    number = int(np.flatnonzero(LIBRARY.family == LIBRARY.names.index("hysteresis"))[0])
    variance, slab = arena.unsure[number] / arena.information[number], LIBRARY.size[number] ** 2
    estimate = one.z[number] * np.sqrt(variance)
    direct = 0.5 * (estimate**2 / variance - estimate**2 / (variance + slab)) + 0.5 * np.log(
        variance / (variance + slab)
    )
    assert one.log_bf[number] == pytest.approx(direct)


def test_replicates_that_differ_much_make_less_sure():
    seen = evidence(hidden(hysteresis=0.2), 8)
    number = int(np.flatnonzero(LIBRARY.family == LIBRARY.names.index("hysteresis"))[0])
    apart = seen.nulls.copy()
    apart[:, PLAN.of("hysteresis")[0]] += np.array([-60.0, -20.0, 20.0, 60.0])
    zs = [
        se.Competition(one, LIBRARY, SETTINGS, one.score, 0.0).component(np.zeros(PLAN.count)).z[number]
        for one in (seen, replace(seen, nulls=apart))
    ]
    assert abs(zs[1]) < 0.8 * abs(zs[0])


def test_a_careful_size_is_never_surer_than_the_exact_one():
    seen = evidence(hidden(location=0.2), 9)
    arena = se.Competition(seen, LIBRARY, SETTINGS, seen.score, 0.0)
    nothing = np.zeros(PLAN.count)
    assert (np.abs(arena.component(nothing, careful=True).z) <= np.abs(arena.component(nothing).z) + 1e-12).all()


def test_units_do_not_matter():
    """Scores of a column in other units, its Gram matrix and typical size likewise, decide the same."""
    seen = evidence(hidden(hysteresis=0.25), 10)
    scale = np.ones(PLAN.count)
    column = PLAN.of("hysteresis")[0]
    scale[column] = 7.0
    other = replace(
        seen,
        u=seen.u * scale,
        nulls=seen.nulls * scale,
        gram=seen.gram * np.outer(scale, scale),
        part=seen.part * scale**2,
    )
    size = LIBRARY.size.copy()
    size[LIBRARY.family == LIBRARY.names.index("hysteresis")] /= 7.0
    library = replace(LIBRARY, size=size)
    one = se.compete(seen, LIBRARY, SETTINGS, seen.score)
    two = se.compete(other, library, SETTINGS, other.score)
    np.testing.assert_allclose(one.components[0].by_family, two.components[0].by_family, atol=1e-6)
