"""What is done with one recording, in whatever process: only tables come back."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from idm_sumo.calibration.status import OK
from idm_sumo.diagnosis.diagnose import diagnose
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.cleaning import clean
from idm_sumo.simulation.driver_parameters import PARAMETERS

from ..diagnosis.content import contract
from ..diagnosis.contract import Diagnosis as Contract
from ..diagnosis.report import DRIVERS, own_drivers
from ..drivers.calibrated import Calibration, calibrated
from ..drivers.predicted import Prediction, predicted
from ..drivers.source import Drivers, Source
from .dataset import PAGE
from .library import library_for
from .pages import page_of_one
from .result import Result

DIAGNOSIS, MODEL = "_diagnosis.json", "_model.json"


class Work(Protocol):
    """What is done with each recording."""

    def on(self, source: Source) -> Result:
        """Do it; raise InputError where the recording does not allow it."""


def work_on(work: Work, source: Source) -> Result:
    """Do the work on a recording.

    Parameters
    ----------
    work : Work
    source : Source
    """
    return work.on(source)


@dataclass(frozen=True)
class Calibrate:
    """Calibrate the drivers.

    Attributes
    ----------
    how : Calibration
    """

    how: Calibration

    def on(self, source: Source) -> Result:
        """Fit every driver.

        Parameters
        ----------
        source : Source
        """
        return _of_drivers(calibrated(source, self.how))


@dataclass(frozen=True)
class Predict:
    """Predict the drivers.

    Attributes
    ----------
    how : Prediction
    drivers : Path or None
        Calibrated drivers to learn from: a table, or the data set of a calibration of many recordings.
    """

    how: Prediction
    drivers: Path | None

    def on(self, source: Source) -> Result:
        """Predict every driver.

        Parameters
        ----------
        source : Source
        """
        return _of_drivers(predict_one(source, self.how, self.drivers))


@dataclass(frozen=True)
class Diagnose:
    """Diagnose the recording.

    Attributes
    ----------
    seed : int
        Of all random draws.
    injections : int
        Of each effect and size, to see which would have been found.
    """

    seed: int
    injections: int = 0

    def on(self, source: Source) -> Result:
        """Name causes and measure the gain.

        Parameters
        ----------
        source : Source
        """
        import numba

        recording = clean(source.read(any_length=True))
        found = diagnose(recording, seed=self.seed, jobs=numba.get_num_threads(), injections=self.injections)
        content = Contract.model_validate(contract(found)).model_dump(mode="json")
        account = recording.accounting
        row = {
            "verdict": content["verdict"], "law": content["law"],
            "causes": ",".join(cause["name"] for cause in content["causes"]),
            "gain_m": content["gain"]["difference"], "drivers": len(found.drivers),
            "rows_read": account.total, "rows_used": account.used,
            "vehicle_seconds": round(len(recording.table) * c.FRAME_STEP, 1), "measured": recording.is_measured,
        }  # fmt: skip
        page = page_of_one(source.path.name, content, is_measured=recording.is_measured)
        files = {
            PAGE: page.encode(),
            DIAGNOSIS: (json.dumps(content, indent=2, allow_nan=False) + "\n").encode(),
            MODEL: replace(found.model, drivers=DRIVERS).to_json().encode(),
        }
        return Result(own_drivers(found, recording), recording.road, row, files)


def predict_one(source: Source, how: Prediction, drivers: Path | None) -> Drivers:
    """Predict the drivers of a recording from calibrated ones.

    Parameters
    ----------
    source : Source
    how : Prediction
    drivers : Path or None
        As of :class:`Predict`.
    """
    return predicted(source, how, None if drivers is None else library_for(source.path, drivers))


def _of_drivers(found: Drivers) -> Result:
    table = found.table
    fitted = table[table["status"] == OK] if "status" in table else table
    row: dict[str, Any] = {
        "drivers": len(table), "ok": len(fitted), "left_out": sum(found.left_out.values()),
        "rows_read": found.rows[0], "rows_used": found.rows[1], "vehicle_seconds": round(found.vehicle_seconds, 1),
    }  # fmt: skip
    if "ade_m" in table:
        row["ade_m"] = float(fitted["ade_m"].mean()) if len(fitted) else np.nan
    for name in PARAMETERS:
        values = fitted[name].dropna().to_numpy(np.float64)
        row[name] = float(values.mean()) if len(values) else np.nan
        row[f"{name}_sd"] = float(values.std(ddof=1)) if len(values) > 1 else np.nan
    return Result(table, found.road, row)
