"""SUMO in this process: start, stop and messages."""

import sys

import pytest

from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo import network
from idm_sumo.sumo.session import load_libsumo, simulation

NETWORK = network.of(US101)


def one_line(error: pytest.ExceptionInfo[InputError]) -> str:
    message = str(error.value)
    assert "\n" not in message
    return message


def test_a_simulation_runs_on_the_section_in_recorded_frames() -> None:
    with simulation(net=NETWORK.file) as sumo:
        assert set(NETWORK.mainline) <= set(sumo.edge.getIDList())
        sumo.simulationStep()
        assert sumo.simulation.getTime() == pytest.approx(FRAME_STEP)
    assert not load_libsumo().isLoaded()


def test_a_second_simulation_is_refused_while_the_first_runs_and_possible_after() -> None:
    with simulation(net=NETWORK.file) as sumo:
        with pytest.raises(RuntimeError, match="one simulation a process"), simulation(net=NETWORK.file):
            pass
        sumo.simulationStep()
    with simulation(net=NETWORK.file) as sumo:
        assert sumo.simulation.getTime() == 0.0


def test_an_error_inside_closes_the_simulation() -> None:
    with pytest.raises(KeyError), simulation(net=NETWORK.file):
        raise KeyError
    assert not load_libsumo().isLoaded()


@pytest.mark.parametrize(
    ("content", "complaint"),
    [(None, "no such network"), ("<net><edge", "unclosed token"), ("<net/>", "has no edge")],
)
def test_a_broken_network_is_named(tmp_path, content, complaint) -> None:
    path = tmp_path / "road.net.xml"
    if content is not None:
        path.write_text(content)
    with pytest.raises(InputError) as error, simulation(net=path):
        pass
    assert complaint in one_line(error)
    assert str(path) in one_line(error)
    with simulation(net=NETWORK.file) as sumo:  # and the process can go on
        sumo.simulationStep()


def test_an_unknown_option_is_named() -> None:
    with pytest.raises(InputError) as error, simulation(["--warp-factor", "9"], net=NETWORK.file):
        pass
    assert "--warp-factor" in one_line(error)


@pytest.mark.parametrize("fault", [ImportError, OSError])
def test_a_missing_system_library_is_named(monkeypatch, fault) -> None:
    class Finder:
        def find_spec(self, name, *_):
            if name == "libsumo":
                raise fault("libGL.so.1: cannot open shared object file: No such file or directory")

    monkeypatch.delitem(sys.modules, "libsumo", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Finder(), *sys.meta_path])
    with pytest.raises(InputError) as error, simulation(net=NETWORK.file):
        pass
    assert "libGL.so.1" in one_line(error)
    assert "libgl1" in one_line(error)
