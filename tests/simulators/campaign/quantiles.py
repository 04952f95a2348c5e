"""Whether z is standard normal with nothing hidden: quantiles of small recordings of each law.

    python -m tests.simulators.campaign.quantiles -o DIR [--each 20] [--jobs 2] [--seed 0]

Writes DIR/z.csv, one row a recording and family of the catalogue at the finder's first look, and DIR/quantiles.png.
Of a family that is looked for in many forms, places or times one is taken, always the same, so that the z of what wins
is not mistaken for it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.stats import norm

from idm_sumo.diagnosis.diagnose import prepared
from idm_sumo.diagnosis.search import looking
from idm_sumo.diagnosis.settings import SETTINGS
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.models.effects import BY_NAME
from idm_sumo.recordings.reading import read_recording
from idm_sumo.runtime.attempts import Failed
from idm_sumo.runtime.progress import silent
from idm_sumo.runtime.spread import spread
from tests.simulators import first

DRIVERS, MINUTES = 150, 3.0
BAND = 0.95  # of order statistics of standard normal numbers, by simulation


def z_of(file: Path, seed: int) -> dict[str, float]:
    """Return z of one hypothesis of each family of the catalogue, without any effect in the model."""
    rng = np.random.default_rng(seed)
    ready = prepared(read_recording(file), rng, None, silent, [])
    if isinstance(ready, Windows):
        return {}
    now = looking(ready.subject, SETTINGS, rng)(ready.followed.fit, ())
    arena, library = now.selection.arena, now.library
    z = arena.component(arena.nothing).z
    members = {name: np.flatnonzero(library.family == n) for n, name in enumerate(library.names) if name in BY_NAME}
    return {name: float(z[each[len(each) // 2]]) for name, each in members.items()}


def run_one(law: str, seed: int, folder: Path) -> list[dict[str, object]]:
    """Make one recording of a law with nothing hidden, and return its rows."""
    file = folder / f"{law}-{seed}.parquet".replace(" ", "_")
    planned = first.plan(seed, effect=None, underlying=law, drivers=DRIVERS, minutes=MINUTES)
    first.write(first.simulate(planned), file)
    rows = [{"law": law, "seed": seed, "family": name, "z": z} for name, z in z_of(file, seed).items()]
    file.unlink()
    return rows


def figure(table: pd.DataFrame) -> Figure:
    """Return the quantiles of each law beside those of a standard normal distribution."""
    laws = list(table["law"].unique())
    drawn = Figure(figsize=(2.6 * len(laws), 3.0), layout="constrained")
    for axes, law in zip(np.atleast_1d(drawn.subplots(1, len(laws), sharey=True)), laws, strict=True):
        z = np.sort(table.loc[table["law"] == law, "z"].to_numpy())
        at = norm.ppf((np.arange(len(z)) + 0.5) / len(z))
        null = np.sort(np.random.default_rng(0).standard_normal((2000, len(z))), axis=1)
        low, high = np.quantile(null, [0.5 - 0.5 * BAND, 0.5 + 0.5 * BAND], axis=0)
        axes.fill_between(at, low, high, color="0.85")
        axes.plot(at, z, ".", ms=3)
        axes.plot(at, at, color="0.4", lw=0.8)
        axes.set(title=f"{law}\n{len(z)} z, deviation {z.std():.2f}", xlabel="standard normal quantile")
    drawn.axes[0].set_ylabel("z")
    return drawn


def main(arguments: list[str] | None = None) -> int:
    """Write the table and the picture, and print deviations by law and by family."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument("--each", type=int, default=20, help="recordings a law")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--seed", type=int, default=0, help="other seeds, other recordings")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    calls = [
        (law, 1000 * (options.seed + 1) + number, options.output)
        for number in range(options.each)
        for law in first.MODELS
    ]
    rows: list[dict[str, object]] = []
    failed = 0
    for done, (number, result) in enumerate(spread(run_one, calls, jobs=options.jobs)):
        if isinstance(result, Failed):
            failed += 1
            print(f"{calls[number][:2]} failed: {result.reason}", file=sys.stderr)
        else:
            rows += result
        print(f"\r{done + 1} of {len(calls)}", end="", file=sys.stderr)
    table = pd.DataFrame(rows)
    table.to_csv(options.output / "z.csv", index=False, float_format="%.4f")
    figure(table).savefig(options.output / "quantiles.png", dpi=150)
    for by in ("law", "family"):
        print(table.groupby(by)["z"].agg(["count", "mean", "std", "min", "max"]).round(2).to_string())
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
