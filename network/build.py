"""Build ``us101.net.xml`` from the plain SUMO sources beside this file.

``python network/build.py [--speed-limit-mph 55] [-o FILE]`` runs netconvert, which comes with
``pip install eclipse-sumo``. The built network is kept in git, so only those who change the
sources need this.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

HERE = Path(__file__).resolve().parent
MPH = 0.44704  # m/s

OPTIONS = (
    "--offset.disable-normalization",  # SUMO's coordinates are the recording's
    # Without lanes inside the junctions one edge begins exactly where the other ends: SUMO's
    # shortest internal lane is 0.1 m, which would be missing from gaps across a junction.
    "--no-internal-links",
    "--no-turnarounds",
    "--precision=4",  # 0.1 mm; 12 ft = 3.6576 m is exact
    "--xml-validation=never",
)  # fmt: skip


class BuildError(RuntimeError):
    """The network could not be built; the message is one line."""


def netconvert() -> Path:
    """Return the path of netconvert, from the eclipse-sumo wheel or the search path.

    Raises
    ------
    BuildError
        If there is none.
    """
    wheel = importlib.util.find_spec("sumo")
    folders = [Path(place) / "bin" for place in (wheel.submodule_search_locations or [])] if wheel else []
    found = shutil.which("netconvert", path=os.pathsep.join(map(str, folders))) or shutil.which("netconvert")
    if found is None:
        raise BuildError("netconvert not found: install it with `pip install eclipse-sumo`, or put SUMO's bin on PATH")
    return Path(found)


def build(output: Path, speed_limit_mph: float | None = None) -> None:
    """Build the network and move it to ``output``.

    Parameters
    ----------
    output : Path
        Where the built network goes.
    speed_limit_mph : float, optional
        Speed limit (mph) of every edge; what ``us101.typ.xml`` says by default.

    Raises
    ------
    BuildError
        If netconvert is missing or fails, or the speed limit is not positive.
    """
    if speed_limit_mph is not None and not 0 < speed_limit_mph < 200:
        raise BuildError(f"--speed-limit-mph {speed_limit_mph}: give a speed limit between 0 and 200 mph")
    if not output.parent.is_dir():
        raise BuildError(f"{output}: folder {output.parent} does not exist; create it first")
    program = netconvert()
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=".build-") as folder:
        types, built = Path(folder, "us101.typ.xml"), Path(folder, "us101.net.xml")
        _write_types(types, speed_limit_mph)
        _run(program, types, built)
        text = built.read_text(encoding="utf-8")
        # netconvert's header holds the date and the paths of one build; without it builds compare.
        built.write_text(re.sub(r"<!--.*?-->\s*", "", text, count=1, flags=re.DOTALL), encoding="utf-8")
        built.replace(output)


def _write_types(path: Path, speed_limit_mph: float | None) -> None:
    """Copy the edge types, with this speed limit if one is given."""
    source = HERE / "us101.typ.xml"
    try:
        tree = ElementTree.parse(source)
    except ElementTree.ParseError as error:
        raise BuildError(f"{source}: {error}; correct the XML") from None
    if speed_limit_mph is not None:
        for edge_type in tree.getroot().iter("type"):
            edge_type.set("speed", f"{speed_limit_mph * MPH:.6g}")
    tree.write(path, encoding="utf-8", xml_declaration=True)


def _run(program: Path, types: Path, built: Path) -> None:
    """Run netconvert on the sources."""
    sources = ("--node-files=us101.nod.xml", "--edge-files=us101.edg.xml", "--connection-files=us101.con.xml")
    command = [str(program), *sources, f"--type-files={types}", f"--output-file={built}", *OPTIONS]
    result = subprocess.run(command, cwd=HERE, capture_output=True, text=True, check=False)
    if result.returncode or not built.is_file():
        lines = (result.stderr or result.stdout).strip().splitlines()
        raise BuildError(f"netconvert failed: {lines[0] if lines else 'no message'}")


def main() -> int:
    """Read the command line and build."""
    parser = argparse.ArgumentParser(description="Build the SUMO network of the US-101 study section.")
    parser.add_argument("--speed-limit-mph", type=float, metavar="MPH", help="speed limit of all edges (55)")
    parser.add_argument("-o", "--output", type=Path, default=HERE / "us101.net.xml", metavar="FILE")
    arguments = parser.parse_args()
    try:
        build(arguments.output.resolve(), arguments.speed_limit_mph)
    except (BuildError, OSError) as error:
        print(f"build.py: {error}", file=sys.stderr)
        return 2
    print(f"built {arguments.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
