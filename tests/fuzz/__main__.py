"""``python -m tests.fuzz -o DIR --runs N``: a long campaign, its counts by kind, and the inputs that end badly."""

from __future__ import annotations

import argparse
import resource
from collections import Counter
from pathlib import Path

from tests.fuzz.campaign import KINDS, campaign


def main() -> None:
    """Run a campaign and print its counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, required=True, help="where inputs that end badly are kept")
    parser.add_argument("--runs", type=int, default=1000, help="inputs of each kind (default 1000)")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    print(f"{'kind':<16}{'tried':>8}{'sound':>8}{'refused':>9}{'faults':>8}")
    for kind in KINDS:
        ends = campaign(options.output, options.runs, options.seed, (kind,))
        count = Counter(end for _, end, _, _ in ends)
        print(f"{kind.name:<16}{len(ends):>8}{count['sound']:>8}{count['refused']:>9}{count['fault']:>8}", flush=True)
        for fault, times in Counter(fault for _, _, fault, _ in ends if fault).most_common(8):
            print(f"    {times} x {fault}", flush=True)
    print(f"largest memory: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10} MB")


if __name__ == "__main__":
    main()
