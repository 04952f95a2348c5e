"""Give a second copy of the package the machine code that a first copy has compiled: ``share_kernels.py FROM TO``.

Numba keeps compiled functions beside their source and trusts them while the source has the same bytes. A wheel's
copy in a fresh environment would compile everything once more, which takes minutes.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path


def share(source: Path, target: Path) -> int:
    """Copy what was compiled below ``source`` to the same places below ``target``; return how many files.

    Compiled code contains what it calls in other modules, so every module must be the same in both.
    """
    modules = [module.relative_to(source) for module in source.rglob("*.py")]
    different = [str(name) for name in modules if (source / name).read_bytes() != (target / name).read_bytes()]
    if different:
        sys.exit(f"not the same in {source} and {target}: {', '.join(different)}")
    compiled = [*source.rglob("__pycache__/*.nb[ic]"), *source.glob("__pycache__/sources.json")]
    for file in compiled:
        twin = target / file.relative_to(source)
        twin.parent.mkdir(exist_ok=True)
        shutil.copy2(file, twin)
    return len(compiled)


if __name__ == "__main__":
    print(f"{share(Path(sys.argv[1]), Path(sys.argv[2]))} files of compiled functions shared")
