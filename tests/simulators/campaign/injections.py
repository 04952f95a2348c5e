"""Whether injections foretell what is found: ``python -m tests.simulators.campaign.injections [SIZE ...]``.

Effects are injected into a recording with nothing hidden, and hidden by the simulator in recordings of the same kind,
one for each effect and size (``small``, ``mid`` or ``large``, by default the first two). Prints a Markdown table: in
how many of four injections each was found, and what was named of the recording. About ten minutes for a size.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from idm_sumo.diagnosis.diagnose import diagnose
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from tests.simulators import first
from tests.simulators.campaign.run import SINGLE, find
from tests.simulators.first.plans import LEVELS, SIZES

KIND = {"underlying": "idm", "noise": "correlated", "sigma": 0.15, "drivers": 400, "minutes": 6.0}
NOTHING_HIDDEN, HIDDEN = 84020100, 84021000  # seeds
NUMBER = 4  # of injections of each effect and size


def recorded(folder: Path, seed: int, effect: str | None, size: str) -> Path:
    """Write a recording in which an effect is hidden, or nothing."""
    file = folder / f"{effect}-{size}.parquet"
    first.write(first.simulate(first.plan(seed=seed, effect=effect, size=size, **KIND)), file)
    return file


def injected(folder: Path) -> dict[tuple[str, str], tuple[float, int]]:
    """Return, by effect and size, what was injected and in how many it was found."""
    recording = clean(read_recording(recorded(folder, NOTHING_HIDDEN, None, "mid"), any_length=True))
    found = diagnose(recording, seed=1, injections=NUMBER).detectable
    ordered: dict[str, list[tuple[float, int]]] = {}
    for one in found:
        ordered.setdefault(one.name, []).append((one.size, one.found))
    return {(name, size): each for name, three in ordered.items() for size, each in zip(LEVELS, three, strict=True)}


def main(sizes: list[str]) -> None:
    """Print the table."""
    print("| effect | injected | found | hidden | named |", "|---|---|---|---|---|", sep="\n", flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        before = injected(folder)
        for size in sizes:
            for number, effect in enumerate(SINGLE):
                seed = HIDDEN + number + 100 * LEVELS.index(size)
                found = find(recorded(folder, seed, effect, size), seed % 2**31)
                named = ", ".join(f"`{cause['name']}`" for cause in found["causes"]) or found["verdict"]
                value, count = before[effect, size]
                hidden = SIZES[effect][LEVELS.index(size)]
                print(f"| `{effect}` | {value:g} | {count} of {NUMBER} | {hidden:g} | {named} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or ["small", "mid"])
