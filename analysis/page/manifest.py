"""What a run was, so that it can be repeated."""

from __future__ import annotations

import argparse
import hashlib
import json
import platform
import shlex
import subprocess
from importlib.metadata import version
from pathlib import Path
from typing import Any

import idm_sumo

PACKAGES = (
    "libsumo",
    "sumolib",
    "numpy",
    "pandas",
    "scipy",
    "scikit-learn",
    "matplotlib",
    "numba",
    "joblib",
    "pyarrow",
)


def manifest(command: list[str], settings: dict[str, Any], inputs: list[Path], **more: Any) -> dict[str, Any]:
    """Return the record of a run.

    Parameters
    ----------
    command : list of str
        As typed.
    settings : dict
    inputs : list of Path
        Files, or folders of Parquet files; each file is recorded with its size and fingerprint.
    **more
        Added as it is.
    """
    files = [file for path in inputs for file in (sorted(path.rglob("*.parquet")) if path.is_dir() else [path])]
    return {
        "command": command,
        "settings": settings,
        "inputs": [
            {"file": path.name, "bytes": path.stat().st_size, "sha256": sha256(path)}
            for path in files
            if path.is_file()
        ],
        "versions": {
            "idm-sumo": idm_sumo.__version__,
            "commit": _commit(),
            "python": platform.python_version(),
            **{name: version(name) for name in PACKAGES},
        },
        "platform": platform.platform(),
        **more,
    }


def repeated(command: list[str]) -> str:
    """Return the line that repeats a run.

    Who computes is left out: it changes no result, so it must not change a page either.

    Parameters
    ----------
    command : list of str
        As typed.
    """
    parser = argparse.ArgumentParser(add_help=False)
    for name in ("--jobs", "--cluster"):
        parser.add_argument(name)
    return shlex.join(["idm-sumo", *parser.parse_known_args(command[1:])[1]])


def write_manifest(path: Path, record: dict[str, Any]) -> None:
    """Write the record as JSON.

    Parameters
    ----------
    path : Path
    record : dict
    """
    path.write_text(json.dumps(record, indent=2, default=str) + "\n", encoding="utf-8")


def sha256(path: Path) -> str:
    """Return the fingerprint of a file.

    Parameters
    ----------
    path : Path
    """
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _commit() -> str | None:
    """Return the commit of a clone, None for a wheel."""
    root = Path(idm_sumo.__file__).parents[1]
    if not (root / ".git").exists():
        return None
    done = subprocess.run(["git", "rev-parse", "HEAD"], cwd=root, capture_output=True, text=True, check=False)
    return done.stdout.strip() or None
