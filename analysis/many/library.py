"""Calibrated drivers to predict from, of one table or of a data set of many recordings."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from idm_sumo.calibration.driver_table import check_drivers, read_drivers
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError

from . import dataset
from .plan import digest


def library_for(recording: Path, drivers: Path) -> pd.DataFrame:
    """Return the drivers that a recording's are predicted from.

    Parameters
    ----------
    recording : Path
        Those of its own drivers that are among them keep their keys, so that each is left out of its prediction.
    drivers : Path
        A driver table, or the data set of `calibrate`; the periods of other recordings then bear their names.

    Raises
    ------
    InputError
        If it is neither, or holds nobody.
    """
    if not drivers.is_dir():
        return read_drivers(drivers)
    data, own = dataset.DataSet(drivers), digest(recording)
    tables = []
    for one in data.kept():
        table = data.tables(one.name)
        if one.sha256 != own and len(table):
            table = table.assign(**{c.PERIOD: f"{one.name}/" + table[c.PERIOD].astype(str)})
        tables.append(table)
    if not any(map(len, tables)):
        raise InputError(
            f"{drivers}: holds no calibrated drivers; `idm-sumo calibrate RECORDING ... -o DIR` makes such"
        )
    whole = pd.concat([table for table in tables if len(table)], ignore_index=True)
    return check_drivers(whole.drop_duplicates([c.PERIOD, c.VEHICLE]), source=str(drivers))
