"""Write recordings and what is hidden in them.

``python -m tests.simulators.second -o DIR --seed S [--cases null=6,single=10,...]``
"""

import argparse
import json
from pathlib import Path

from tests.simulators.second import cases
from tests.simulators.second.recordings import make, truth

DEFAULT = "null=6,single=10,some_drivers=0,one_lane=0,pair=4,outside=4"


def main():
    """Write the recordings that are not there yet."""
    parser = argparse.ArgumentParser(prog="python -m tests.simulators.second", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", default=DEFAULT, help=f"how many of each kind (default {DEFAULT})")
    options = parser.parse_args()
    counts = dict.fromkeys(cases.KINDS, 0) | {k: int(n) for k, n in (c.split("=") for c in options.cases.split(","))}
    for folder in ("rec", "truth"):
        (options.output / folder).mkdir(parents=True, exist_ok=True)
    plan = cases.plan(options.seed, counts)
    for number, case in enumerate(plan, 1):
        path = options.output / "truth" / f"{number:03d}.json"
        if path.exists():
            continue
        got, wrong = make(options.seed, number, case)
        got["table"].to_parquet(options.output / "rec" / f"{number:03d}.parquet", index=False)
        path.write_text(json.dumps(truth(number, case, got, wrong), indent=1))
        print(f"{number}/{len(plan)}", *(["FAULTS", *wrong] if wrong else []), flush=True)


if __name__ == "__main__":
    main()
