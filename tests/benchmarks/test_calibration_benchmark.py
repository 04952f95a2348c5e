"""Fits a second against what others calibrate with, on the same compiled objective; cost against the number of drivers.

Run with ``pytest tests/benchmarks/test_calibration_benchmark.py --benchmark-only -s``.
"""

import resource
import time

import numpy as np
import pytest
from scipy.optimize import differential_evolution

from idm_sumo.calibration import calibrate, reference, solver
from idm_sumo.calibration.kernel import LOWER, PARAMETERS, UPPER, costs_of
from idm_sumo.calibration.problem import only, prepare
from tests.helpers.known_drivers import known_drivers

SLOW = 60  # drivers, for the references
EVOLVED = 6
SIZES = (100, 1_000, 10_000, 100_000)


def timed(work, clock=time.perf_counter):
    start = clock()
    result = work()
    return result, clock() - start


def evolve(problem, which):
    """Fit drivers ``which`` by scipy's differential evolution; return search coordinates and objective."""
    z, value = np.empty((len(which), PARAMETERS)), np.empty(len(which))
    bounds = list(zip(LOWER, UPPER, strict=True))
    for q, i in enumerate(which):
        one = only(problem, np.array([i]))
        found = differential_evolution(
            lambda at, one=one: costs_of_columns(one, at),
            bounds, rng=np.random.default_rng([0, int(i)]), vectorized=True, updating="deferred",
        )  # fmt: skip
        z[q], value[q] = found.x, found.fun
    return z, value


def costs_of_columns(problem, at):
    """Return the first driver's cost at every column of ``at``, shape ``(5, m)``; or at ``(5,)`` itself."""
    z = np.ascontiguousarray(np.atleast_2d(at.T))
    values = np.empty(len(z))
    costs_of(problem, 0, z, 0.0, values)
    return values if at.ndim == 2 else values[0]


def test_fits_a_second_side_by_side(benchmark):
    """Ours against scipy's L-BFGS-B (finite differences, and with our derivatives) and differential evolution."""
    scenes, _ = known_drivers(3476, noise=0.2, seed=1)
    problem, designs = prepare(scenes), solver.design_of_starts(solver.STARTS)
    everybody = np.arange(len(scenes))
    solver.fit_all(problem, everybody[:2], designs)
    reference.l_bfgs_b(problem, everybody[:1], starts=1)
    reference.l_bfgs_b(problem, everybody[:1], starts=1, derivatives=True)
    (_, ours, _), seconds = timed(lambda: solver.fit_all(problem, everybody, designs), time.process_time)
    benchmark.pedantic(solver.fit_all, (problem, everybody, designs), rounds=3)
    rivals = {
        "L-BFGS-B, differences, 10 starts": (SLOW, lambda p, w: reference.l_bfgs_b(p, w)),
        "L-BFGS-B, our derivatives, 10 starts": (SLOW, lambda p, w: reference.l_bfgs_b(p, w, derivatives=True)),
        "L-BFGS-B, differences, 1 start": (SLOW, lambda p, w: reference.l_bfgs_b(p, w, starts=1)),
        "differential evolution": (EVOLVED, evolve),
    }
    rate = len(ours) / seconds
    print(
        "\n\n| solver | fits a second of one core | ours is faster by | mean objective (m) "
        "| ours, same drivers | ours as good |"
    )
    print("|---|---|---|---|---|---|")
    print(f"| ours | {rate:.0f} | | {ours.mean():.4f} | {ours.mean():.4f} | |")
    for name, (count, fit) in rivals.items():
        (_, theirs), taken = timed(
            lambda fit=fit, count=count: fit(only(problem, everybody[:count]), everybody[:count]), time.process_time
        )
        same = ours[:count]
        good = (same <= 1.01 * theirs + 0.01).mean()
        benchmark.extra_info[name] = rate * taken / count
        figures = (
            f"{count / taken:.1f} | {rate * taken / count:.0f} | {theirs.mean():.4f} | {same.mean():.4f} | {good:.1%}"
        )
        print(f"| {name} | {figures} |")
        assert good >= 0.9  # these drivers are the IDM but for noise, where the last millimetres are the hardest
        assert rate > 2 * count / taken


@pytest.mark.parametrize("seconds", [10])
def test_cost_against_the_number_of_drivers(benchmark, seconds):
    """The whole of ``calibrate``, from scenes to the table: linear in the drivers, memory bounded by chunks."""
    calibrate(known_drivers(4, seconds=seconds)[0])
    some, _ = known_drivers(10_000, seconds=seconds, noise=0.2, seed=2)
    print("\n\n| drivers | seconds | ms a driver | peak memory (GiB) |")
    print("|---|---|---|---|")
    cost = {}
    for size in SIZES:
        scenes = some.subset(np.arange(size) % len(some))
        if size == SIZES[-1]:
            table = benchmark.pedantic(calibrate, (scenes,), rounds=1)
            taken = benchmark.stats.stats.min
        else:
            table, taken = timed(lambda scenes=scenes: calibrate(scenes))
        assert len(table) == size
        cost[size] = taken / size
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        print(f"| {size:,} | {taken:.2f} | {1e3 * taken / size:.3f} | {peak:.2f} |")
    benchmark.extra_info.update({str(size): value for size, value in cost.items()})
    assert cost[100_000] < 1.5 * cost[1_000]
