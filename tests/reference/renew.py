"""Make the pinned tables anew after a deliberate change: ``python -m tests.reference.renew``."""

from __future__ import annotations

import tempfile
from pathlib import Path

from tests.helpers import runs
from tests.reference import pinned_tables as p


def main() -> None:
    """Run the commands on their recordings and keep what they leave."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        platoons, drivers = folder / "platoons.parquet", folder / "drivers.parquet"
        runs.write_platoons(folder)
        runs.calibrate(folder, platoons)
        runs.reproduce(folder, platoons)
        runs.diagnose(folder)
        p.write(p.calibrated(drivers))
        p.write(p.predicted(folder, platoons, drivers))
        p.write(p.replayed(folder, platoons, drivers))
        p.write(p.driven_in_a_loop(folder, platoons, drivers))
        p.write(p.studied(folder / "study"))
        p.write(p.diagnosed(folder / "diagnosis"))


if __name__ == "__main__":
    main()
