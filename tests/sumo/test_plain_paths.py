"""Paths that hold what is syntax in SUMO's options."""

import os
import shutil
from pathlib import Path

import pytest

from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.siblings import PREFIX
from idm_sumo.sumo import network
from idm_sumo.sumo.closed_loop.insertion import departure_delays
from idm_sumo.sumo.export.distribution import export_distribution
from idm_sumo.sumo.export.routes import export_routes
from idm_sumo.sumo.plain_paths import is_plain, plain
from idm_sumo.sumo.session import simulation
from tests.helpers.exports import drivers

HARMLESS = ("x y", "h#s", "&<t", "ünï", "TIME", "stdout")
SYNTAX = (
    "a,b",
    "${HOME}",
    "$HOME",
    "p%41c",
    "~",
    "co:lon",
    "back\\slash",
    "q'u",
    'q"t',
    "se;mi",
    "new\nline",
    "a, b.c",
)


@pytest.mark.parametrize("name", [*HARMLESS, *SYNTAX])
def test_sumo_reads_and_writes_the_files_that_are_meant(tmp_path: Path, name: str) -> None:
    folder = tmp_path / name
    folder.mkdir()
    exported = export_routes(drivers(), folder / "e.rou.xml")
    assert len(departure_delays(exported.config_file)) == len(exported.vehicles)
    fcd = folder / "fcd.parquet"
    with simulation(
        ["--route-files", str(exported.route_file), "--fcd-output", str(fcd)], net=exported.net_file
    ) as sumo:
        sumo.simulationStep()
    assert fcd.stat().st_size > 0
    assert is_plain(name) == (name in HARMLESS)


@pytest.mark.parametrize("name", SYNTAX)
def test_a_network_of_such_a_name_is_read(tmp_path: Path, name: str) -> None:
    net = tmp_path / f"{name}.net.xml"
    shutil.copy(network.of(US101).file, net)
    with simulation(net=net) as sumo:
        assert "weave" in sumo.edge.getIDList()


@pytest.mark.parametrize("name", SYNTAX)
def test_an_export_of_such_a_name_is_refused_as_no_configuration_can_hold_it(tmp_path: Path, name: str) -> None:
    for write in (export_routes, export_distribution):
        with pytest.raises(InputError, match="choose another name"):
            write(drivers(), tmp_path / f"{name}.rou.xml")
    assert list(tmp_path.iterdir()) == []


def test_links_are_gone_afterwards_and_a_bad_temporary_folder_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    with plain(tmp_path / "a,b" / "x.net.xml", ["--seed", "1"]) as (net, options):
        assert is_plain(net)
        assert options == ["--seed", "1"]
        assert any(name.startswith(PREFIX) for name in os.listdir(temporary))
    assert os.listdir(temporary) == []
    bad = tmp_path / "c,d"
    bad.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(bad))
    with pytest.raises(InputError, match="TMPDIR"), plain(tmp_path / "a,b" / "x.net.xml", []):
        pass
