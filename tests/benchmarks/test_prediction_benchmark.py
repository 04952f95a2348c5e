"""Prediction through the rollout against the paper's neighbours, in batch and one driver at a time.

Run with ``pytest tests/benchmarks/test_prediction_benchmark.py --benchmark-only -s``.
"""

import time

import numpy as np

from idm_sumo.prediction import KNNPredictor, RolloutPredictor, first_second
from idm_sumo.prediction.driving_code import FEATURES, driving_code
from tests.helpers.known_drivers import known_drivers

TRAINING, BATCH, SINGLE = 300, 5000, 300


def microseconds(work, repeats):
    work()
    start = time.process_time()
    for _ in range(repeats):
        work()
    return 1e6 * (time.process_time() - start) / repeats


def test_microseconds_a_driver(benchmark):
    scenes, theta = known_drivers(TRAINING, noise=0.2, seed=1)
    rows = np.arange(BATCH) % TRAINING
    seconds, codes = first_second(scenes).to_numpy()[rows], driving_code(scenes, 10)[list(FEATURES.values())].to_numpy()
    ours = RolloutPredictor().fit(scenes)
    paper = KNNPredictor(features=None).fit(codes, theta)
    codes = codes[rows]
    figures = {}
    for name, model, inputs in (("through the rollout", ours, seconds), ("the paper's neighbours", paper, codes)):
        batch = microseconds(lambda m=model, x=inputs: m.predict(x), 10) / BATCH
        single = microseconds(lambda m=model, x=inputs: m.predict(x[:1]), SINGLE)
        figures[name] = batch, single
    print("\n\n| prediction | µs a driver in batch | µs for a single call |")
    print("|---|---|---|")
    for name, (batch, single) in figures.items():
        print(f"| {name} | {batch:.2f} | {single:.0f} |")
    benchmark.pedantic(ours.predict, (seconds,), rounds=5)
    (batch, single), (paper_batch, paper_single) = figures.values()
    benchmark.extra_info.update(batch_against_paper=batch / paper_batch, single_against_paper=single / paper_single)
    assert batch < 50.0
    assert single < 1000.0
