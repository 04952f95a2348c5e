"""Driver tables to export, and the real `sumo` program with its own schemas."""

from __future__ import annotations

import importlib.util
import os
import subprocess
from pathlib import Path
from xml.etree.ElementTree import Element, parse

import numpy as np
import pandas as pd
import pytest

PERIODS = ("0750-0805", "0805-0820")


def drivers(n: int = 30, seed: int = 1, **columns: object) -> pd.DataFrame:
    """Drivers of two periods that enter one by one, on all five lanes, some on the on-ramp."""
    rng = np.random.default_rng(seed)
    table = pd.DataFrame({
        "period": np.where(np.arange(n) < n // 2, *PERIODS), "vehicle": np.arange(n) % (n // 2) + 10,
        "a": rng.uniform(0.5, 2, n), "b": rng.uniform(1, 3, n), "T": rng.uniform(0.8, 2, n), "d0": rng.uniform(1, 3, n),
        "d1": 0.0, "status": "ok", "at_bound": "",
        "depart_s": np.arange(n) % (n // 2) * 2.3 + 0.1, "lane": np.arange(n) % 7 + 1,
        "x_m": np.where(np.arange(n) % 7 == 5, 200.0, np.where(np.arange(n) % 7 == 6, 100.0, 3.0)),
        "y_m": -2.0, "speed_m_s": rng.uniform(8, 14, n), "length_m": rng.uniform(4, 12, n), "width_m": 2.0,
        "vehicle_class": rng.integers(0, 4, n),
    })  # fmt: skip
    return table.assign(**columns)


def read_types(route_file: Path) -> dict[str, Element]:
    """Return the vehicle types of an exported file by their names, as they stand there."""
    return {element.attrib["id"]: element for element in parse(route_file).getroot().iter("vType")}


def sumo(config: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run the real program of the eclipse-sumo wheel, with its own schemas."""
    wheel = importlib.util.find_spec("sumo")
    if wheel is None or not wheel.submodule_search_locations:
        pytest.skip("eclipse-sumo is not installed")
    home = Path(wheel.submodule_search_locations[0])
    environment = {**os.environ, "SUMO_HOME": str(home)}
    command = [
        str(home / "bin" / "sumo"),
        "-c",
        str(config),
        "--xml-validation",
        "always",
        "--xml-validation.net",
        "always",
        *options,
    ]
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False, timeout=120)
