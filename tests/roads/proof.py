"""Known truth on five networks: SUMO traffic of known IDM drivers, read on its network and calibrated.

``python -m tests.roads.proof -o docs/roads_table.md`` writes the table. SUMO records every 0.1, 0.5 or 1 s, with and
without 0.2 m of noise; drivers are calibrated over windows of 10, 30 and 60 s. Drivers are known, so that the error of
each parameter is, too: of those that a window determines, by the calibration's own word.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.calibration import calibrate, integrators
from idm_sumo.calibration.problem import prepare
from idm_sumo.calibration.type_fit import fit_types
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smooth, smoothness
from idm_sumo.runtime.files import new_file
from idm_sumo.scenes.windows import Scenes, Window, build_scenes
from idm_sumo.sumo.own_network import road_of
from tests.roads import networks, traffic

SECONDS = 150.0  # of every run
STEPS, NOISES, LENGTHS = (0.1, 0.5, 1.0), (0.0, 0.2), (10, 30, 60)  # s, m, s
DRIVERS = 60
WINDOWS = 300  # at most, of a network, step, noise and length
SETTLED = 200.0  # m, by which a vehicle follows: where it enters, SUMO may brake it harder than any IDM
PARAMETERS = ("a", "b", "T", "d0")
ADES = {"ADE (m)": "ade_m", "ADE of types (m)": "ade_type_m"}


@dataclass(frozen=True)
class Truth:
    """A run of known drivers.

    Attributes
    ----------
    fcd : pandas.DataFrame
        SUMO's output every 0.1 s.
    driver : dict of str to int
        Which row of ``drivers`` each vehicle is.
    drivers : pandas.DataFrame
    net : Path
    routes : Path
    """

    fcd: pd.DataFrame
    driver: dict[str, int]
    drivers: pd.DataFrame
    net: Path
    routes: Path


def make(one: networks.Network, folder: Path, *, seed: int = 1, seconds: float = SECONDS) -> Truth:
    """Make the traffic of a network."""
    rng = np.random.default_rng(seed)
    drivers = traffic.draw(DRIVERS, rng)
    net, routes, fcd = networks.build(one, folder), folder / "r.rou.xml", folder / "fcd.parquet"
    driver = traffic.write_routes(one, drivers, routes, seconds)
    traffic.drive(one, net, routes, fcd, seconds=seconds, rng=rng)
    return Truth(pd.read_parquet(fcd), driver, drivers, net, routes)


def recorded(
    one: networks.Network, truth: Truth, folder: Path, *, step: float, noise: float, seed: int = 1
) -> Recording:
    """Return the run as it is recorded every ``step`` s with ``noise`` m along the road."""
    table = truth.fcd
    every = (table["timestep_time"] * 10).round().astype(int) % round(10 * step) == 0
    table = table[every].copy()
    path = folder / "recorded.parquet"
    table.to_parquet(path, index=False)
    found = read_recording(path, road=road_of(truth.net, one.corridor), route_files=[truth.routes])
    if noise:
        error = np.random.default_rng(seed).normal(0.0, noise, len(found.table))
        found = found.with_table(found.table.assign(**{c.X: found.table[c.X] + error}))
        found = smoothness(found)
    return smooth(clean(found))


def named(recording: Recording, truth: Truth) -> dict[int, str]:
    """Return the name of each vehicle's number: they were numbered in the order of the file."""
    names = list(dict.fromkeys(truth.fcd["vehicle_id"].astype(str)))
    return dict(enumerate(names, 1))


def errors(one: networks.Network, truth: Truth, recording: Recording, seconds: int) -> pd.DataFrame:
    """Calibrate windows of a length and return, for each driver, its error and what is true of it."""
    scenes = build_scenes(recording, Window(observed=10, horizon=10 * seconds - 10, every=100))
    scenes = scenes.subset(np.unique(np.linspace(0, len(scenes) - 1, WINDOWS).astype(np.int64)))
    fits = calibrate(scenes)
    fits = fits.join(_types(fits, scenes))
    name = fits["vehicle"].map(named(recording, truth))
    known = truth.drivers.iloc[name.map(truth.driver).to_numpy()].reset_index(drop=True)
    fits = fits.join(known.add_suffix("_true"))
    lane = np.abs(np.diff(scenes.y, axis=1)).max(axis=1) < 1.0  # who keeps its lane
    settled = scenes.x[:, 0] > SETTLED
    driven = ~name.str.startswith(traffic.FIRST).to_numpy()
    return fits[
        lane & settled & driven & (fits["status"] == "ok").to_numpy() & (fits["leader_changes"] == 0).to_numpy()
    ]


def _types(fits: pd.DataFrame, scenes: Scenes) -> pd.DataFrame:
    """Return the vehicle type of each window, and its ADE as SUMO integrates."""
    problem = prepare(scenes, desired_speed=fits["desired_speed_m_s"].to_numpy())
    start = fits[["a", "b", "T", "d0", "d1"]].fillna(dict(zip(TEXTBOOK._fields, TEXTBOOK, strict=True)))
    types = fit_types(problem, np.arange(len(fits) + 1), start.to_numpy(), integration="euler")
    table = pd.DataFrame(types[:, :4], fits.index, [f"{name}_type" for name in PARAMETERS])
    return table.assign(ade_type_m=integrators.ades(problem, types, "euler"))


def summary(fits: pd.DataFrame) -> dict[str, float]:
    """Return mean ADEs, and per parameter the median relative error, log-correlation and coverage.

    The first ADE is of five parameters under the calibration's integration, the second of the vehicle types: four
    parameters under SUMO's.
    """
    row: dict[str, float] = {"windows": len(fits)}
    for name, column in ADES.items():
        row[name] = fits[column].mean() if len(fits) else np.nan
    for name in PARAMETERS:
        sure = ~fits["undetermined"].str.split(",").map(lambda names, one=name: one in names)
        some = fits[sure & fits[f"{name}_type"].notna()]
        found, true = some[f"{name}_type"], some[f"{name}_true"]
        enough = len(some) > 4
        row[f"{name}: determined"] = sure.mean() if len(fits) else np.nan
        row[f"{name}: error"] = float(((found - true).abs() / true).median()) if enough else np.nan
        row[f"{name}: log-correlation"] = float(np.corrcoef(np.log(found), np.log(true))[0, 1]) if enough else np.nan
    return row


@dataclass(frozen=True)
class Grid:
    """What is varied: steps (s), noise (m), lengths of windows (s)."""

    steps: tuple[float, ...] = STEPS
    noises: tuple[float, ...] = NOISES
    lengths: tuple[int, ...] = LENGTHS


def table(*, seed: int = 1, which: tuple[str, ...] = (), grid: Grid = Grid()) -> pd.DataFrame:
    """Return the errors on every network, step, noise and length of windows."""
    rows = []
    for one in networks.EVERY:
        if which and not any(word in one.name for word in which):
            continue
        with tempfile.TemporaryDirectory() as place:
            truth = make(one, Path(place), seed=seed)
            for step in grid.steps:
                for noise in grid.noises:
                    recording = recorded(one, truth, Path(place), step=step, noise=noise, seed=seed)
                    for seconds in grid.lengths:
                        found = summary(errors(one, truth, recording, seconds))
                        rows.append(
                            {"network": one.name, "step (s)": step, "noise (m)": noise, "window (s)": seconds} | found
                        )
                        print(rows[-1], flush=True)
    return pd.DataFrame(rows)


def markdown(found: pd.DataFrame) -> str:
    """Return the table as Markdown: errors in percent, correlations of logarithms."""
    head = ["network", "step (s)", "noise (m)", "window (s)", "windows", *ADES]
    shown = found[head].astype(str).assign(**{name: found[name].map("{:.4f}".format) for name in ADES})
    for name in PARAMETERS:
        told = (found[f"{name}: {what}"] for what in ("determined", "error", "log-correlation"))
        shown[name] = [_told(*one) for one in zip(*told, strict=True)]
    rows = [list(shown), ["---"] * len(shown.columns), *shown.to_numpy().tolist()]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _told(determined: float, error: float, correlation: float) -> str:
    """Return the share of windows that determine a parameter, its median error and correlation in them."""
    return f"{determined:.0%}" + ("" if np.isnan(error) else f": {error:.1%}, {correlation:.2f}")


def main() -> None:
    """Write the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[], metavar="WORD", help="of the networks' names")
    parser.add_argument("--steps", nargs="+", type=float, default=STEPS, metavar="S")
    parser.add_argument("--noises", nargs="+", type=float, default=NOISES, metavar="M")
    parser.add_argument("--lengths", nargs="+", type=int, default=LENGTHS, metavar="S")
    options = parser.parse_args()
    grid = Grid(tuple(options.steps), tuple(options.noises), tuple(options.lengths))
    found = table(seed=options.seed, which=tuple(options.only), grid=grid)
    found.to_csv(options.output.with_suffix(".csv"), index=False)
    with new_file(options.output) as part:
        part.write_text(markdown(found), encoding="utf-8")


if __name__ == "__main__":
    main()
