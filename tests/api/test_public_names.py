"""The names that `import idm_sumo` gives: there, not shadowed by rooms, and loaded only when used."""

import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec

import pytest

import idm_sumo


def run(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def test_importing_the_package_loads_nothing_heavy():
    heavy = ["numpy", "pandas", "numba", "sklearn", "scipy", "pyarrow", "matplotlib", "libsumo", "rich"]
    loaded = f"import sys, idm_sumo; print([name for name in {heavy} if name in sys.modules])"
    assert run(loaded) == "[]"


@pytest.mark.parametrize("name", idm_sumo.__all__)
def test_a_public_name_is_what_its_module_holds(name):
    value = getattr(idm_sumo, name)
    if name != "__version__":
        assert value is getattr(import_module(value.__module__), name)
        assert value.__doc__


def test_no_public_name_is_that_of_a_module():
    assert not [name for name in idm_sumo.__all__ if find_spec(f"idm_sumo.{name}")]


def test_rooms_imported_before_or_after_do_not_hide_names():
    code = (
        "import idm_sumo{}; from idm_sumo import calibrate, score; import idm_sumo.calibration.table; "
        "print(callable(idm_sumo.calibrate), callable(idm_sumo.score))"
    )
    for first in ("", ".calibration", ".evaluation.metrics"):
        assert run(code.format(first)) == "True True"


def test_dir_lists_the_public_names_and_another_name_is_refused():
    assert dir(idm_sumo) == sorted(idm_sumo.__all__)
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = idm_sumo.no_such_name
