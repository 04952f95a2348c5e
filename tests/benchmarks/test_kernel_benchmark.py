"""Our compiled rollouts against a C floor: the same equations behind a known leader, by ``gcc -O3 -march=native``.

``pytest tests/benchmarks/test_kernel_benchmark.py --benchmark-only -n 0``; skipped without gcc. Ours also search for
another leader where a vehicle leaves its recorded neighbours, and serve other objectives and integrations.
"""

import ctypes
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from idm_sumo.calibration import integrators
from idm_sumo.calibration.coordinates import to_search
from idm_sumo.calibration.kernel import costs
from idm_sumo.calibration.problem import prepare
from tests.helpers.known_drivers import known_drivers

SOURCE = Path(__file__).with_name("floor.c")
FLAGS = ("-O3", "-march=native", "-ffast-math", "-shared", "-fPIC")  # fast-math: the floor may reorder, we may not
DRIVERS, SETS, REPEATS = 2000, 64, 9


@pytest.fixture(scope="module")
def floor(tmp_path_factory):
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("gcc is not there")
    library = tmp_path_factory.mktemp("floor") / "floor.so"
    subprocess.run([compiler, *FLAGS, str(SOURCE), "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library))


@pytest.fixture(scope="module")
def problem():
    """Drivers whose every parameter set stays behind the recorded leader."""
    scenes, theta = known_drivers(DRIVERS, noise=0.2, seed=4)
    return prepare(scenes), theta


def pointer(values):
    """Return an array of float64 as C takes it."""
    assert values.dtype == np.float64
    assert values.flags.c_contiguous
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def call(function, sizes, arrays):
    function(*map(ctypes.c_long, sizes), *map(pointer, arrays))


def least_seconds(work):
    """Return the least CPU seconds of several runs; other work on the machine can only add to them."""
    taken = []
    for _ in range(REPEATS):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return min(taken)


def compare(benchmark, ours, theirs, rollouts):
    """Note nanoseconds a rollout and frame, and ours as times the floor."""
    benchmark.pedantic(ours, rounds=3, warmup_rounds=1)
    floor_taken = least_seconds(theirs)
    own = least_seconds(ours)
    benchmark.extra_info["ns a vehicle-frame"] = 1e9 * own / rollouts
    benchmark.extra_info["ns a vehicle-frame in C"] = 1e9 * floor_taken / rollouts
    benchmark.extra_info["time / C"] = own / floor_taken


def test_costs_of_many_parameter_sets(benchmark, floor, problem):
    """What a calibration asks for: the mean error of many parameter sets of a driver, eight side by side."""
    p, theta = problem
    near = theta[:, None, :] * np.random.default_rng(0).uniform(0.9, 1.1, (DRIVERS, SETS, 5))
    z, found = to_search(near), np.empty((DRIVERS, SETS))
    h = p.target.shape[1]
    rear, leader = p.rear, p.leader_speed
    arrays = (near, p.start_x, p.start_speed, p.desired_speed, p.forward, p.target, p.lateral, rear, leader, found)
    compare(
        benchmark, lambda: costs(p, z, 0.0), lambda: call(floor.costs, (DRIVERS, SETS, h), arrays),
        DRIVERS * SETS * h,
    )  # fmt: skip
    assert_allclose(found, costs(p, z, 0.0), rtol=1e-9)


def test_one_rollout_a_driver(benchmark, floor, problem):
    """What an evaluation asks for: positions and speeds of one parameter set a driver."""
    p, theta = problem
    h = p.target.shape[1]
    x, speed = np.empty((DRIVERS, h + 1)), np.empty((DRIVERS, h + 1))
    arrays = (
        theta, p.start_x, p.start_speed, p.desired_speed, p.forward, p.rear, p.leader_speed, x, speed
    )  # fmt: skip
    compare(
        benchmark, lambda: integrators.drive(p, theta, "paper"), lambda: call(floor.drive, (DRIVERS, h), arrays),
        DRIVERS * h,
    )  # fmt: skip
    ours = integrators.drive(p, theta, "paper")
    assert_allclose(x, ours[0], rtol=1e-9)
    assert_allclose(speed, ours[1], atol=1e-9)
