"""What the commands' tables hold for small recordings: made, kept beside this file, and compared.

A table that changes on purpose is renewed by ``python -m tests.reference.renew``; look at the
difference in git before it is committed.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.testing import assert_allclose

from idm_sumo.cli import main
from tests.helpers.runs import LATER

PINNED = Path(__file__).parent / "pinned"
# Tables print six digits. Another processor rounds differently; beyond this a number has changed.
RELATIVE, ABSOLUTE = 2e-5, 1e-7
VEHICLE = 3
STEPS = 40
OF_THE_DRIVERS = [
    "period", "vehicle", "first_frame", "a", "b", "T", "d0", "d1", "ade_m", "objective", "status", "at_bound",
    "undetermined", "frames", "leader_frames", "leader_changes", "effective_frames", "a_sd", "T_sd",
]  # fmt: skip


def calibrated(drivers: Path) -> dict[str, pd.DataFrame]:
    """Return the calibrated drivers."""
    return {"calibrate": pd.read_parquet(drivers)[OF_THE_DRIVERS]}


def predicted(folder: Path, platoons: Path, drivers: Path) -> dict[str, pd.DataFrame]:
    """Return drivers predicted from one second by their neighbours."""
    main(["predict", str(platoons), "--drivers", str(drivers), "-o", str(folder / "predicted.parquet")])
    table = pd.read_parquet(folder / "predicted.parquet")
    return {"predict": table[["period", "vehicle", "a", "b", "T", "d0", "d1", "status"]]}


def replayed(folder: Path, platoons: Path, drivers: Path) -> dict[str, pd.DataFrame]:
    """Return a driver's path by both back ends, driven by its calibrated parameters."""
    tables = {}
    for backend in ("sumo", "kernel"):
        out = folder / backend
        main(["replay", str(platoons), "--vehicle", str(VEHICLE), "--period", LATER, "--horizon", str(STEPS),
              "--drivers", str(drivers), "--backend", backend, "-o", str(out)])  # fmt: skip
        tables[f"replay-{backend}"] = pd.read_parquet(out / "trajectory.parquet")[::10].reset_index(drop=True)
        tables[f"replay-{backend}-scores"] = pd.read_csv(out / "scores.csv")
    return tables


def driven_in_a_loop(folder: Path, platoons: Path, drivers: Path) -> dict[str, pd.DataFrame]:
    """Return what reacting vehicles with the calibrated parameters do in SUMO."""
    out = folder / "loop"
    main(["interactive", str(platoons), "--period", LATER, "--drivers", str(drivers), "--types", "drivers",
          "--replay-bias", "0", "--jobs", "1", "-o", str(out)])  # fmt: skip
    return {f"interactive-{name}": pd.read_csv(out / "tables" / f"{name}.csv") for name in ("closed_loop", "ranking")}


def studied(study: Path) -> dict[str, pd.DataFrame]:
    """Return all tables of ``reproduce`` but the oracle's, which is that of ``calibrate``."""
    files = sorted((study / "tables").glob("*.csv"))
    return {f"reproduce-{file.stem}": pd.read_csv(file) for file in files if file.stem != "oracle"}


def diagnosed(diagnosis: Path) -> dict[str, pd.DataFrame]:
    """Return verdict, law, causes with their sizes, and gain of a diagnosis."""
    content = json.loads((diagnosis / "diagnosis.json").read_text())
    rows = [("verdict", content["verdict"], np.nan), ("law", content["law"], np.nan)]
    for cause in content["causes"]:
        rows += [(cause["name"], symbol, one["value"]) for symbol, one in cause["parameters"].items()]
    rows += [("gain", name, content["gain"][name]) for name in ("base", "extended")]
    return {"diagnose": pd.DataFrame(rows, columns=["what", "which", "value"])}


def write(tables: dict[str, pd.DataFrame]) -> None:
    """Keep tables as the reference."""
    for name, table in tables.items():
        table.to_csv(PINNED / f"{name}.csv", index=False, float_format="%.8g")


def compare(tables: dict[str, pd.DataFrame]) -> None:
    """Raise unless tables are as they were kept; columns that a reference does not have are free to come."""
    assert tables
    for name, table in tables.items():
        kept = pd.read_csv(PINNED / f"{name}.csv")
        assert len(table) == len(kept), f"{name}: {len(table)} rows, {len(kept)} in the reference"
        for column in kept:
            where = f"{name}, column {column}; if it changed on purpose: python -m tests.reference.renew"
            found, wanted = table[column], kept[column]
            numbers, wanted_numbers = (pd.to_numeric(one, errors="coerce") for one in (found, wanted))
            assert_allclose(numbers.astype(float), wanted_numbers.astype(float), RELATIVE, ABSOLUTE, err_msg=where)
            texts, wanted_texts = (
                one[n.isna()].fillna("").astype(str).tolist() for one, n in ((found, numbers), (wanted, wanted_numbers))
            )
            assert texts == wanted_texts, where
