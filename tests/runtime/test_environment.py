"""Where caches stand, that kernels of other sources are never used, and that BLAS takes one thread."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from idm_sumo.runtime import environment
from idm_sumo.runtime.environment import NUMBA_CACHE, SOURCES, find_places_for_caches, fingerprint, forget_older_kernels


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package with kernels in two rooms, of which one calls the other."""
    texts = {
        "models": "from numba import njit\n@njit(cache=True)\ndef kernel(): return 1\n",
        "simulation": "from idm_sumo.models.kernel import kernel\n@njit(cache=True)\ndef caller(): return kernel()\n",
        "analysis": "shipped = True\n",
    }
    for room, text in texts.items():
        folder = tmp_path / "package" / room / "__pycache__"
        folder.mkdir(parents=True)
        folder.with_name("kernel.py").write_text(text)
    (tmp_path / "package" / "models" / "constants.py").write_text("VALUE = 1\n")
    compile_kernels(tmp_path / "package")
    return tmp_path / "package"


def compile_kernels(package: Path) -> None:
    for room in ("models", "simulation"):
        (package / room / "__pycache__" / "kernel.step-1.py311.nbi").write_bytes(b"machine code")


def kernels(package: Path) -> set[str]:
    return {kernel.parts[-3] for kernel in package.rglob("*.nbi")}


def test_kernels_of_unknown_sources_go_and_those_of_known_ones_stay(package: Path) -> None:
    forget_older_kernels(package)
    assert kernels(package) == set()  # nobody knows what they were compiled from
    compile_kernels(package)
    forget_older_kernels(package)
    assert kernels(package) == {"models", "simulation"}


@pytest.mark.parametrize(
    ("changed", "left"),
    [
        ("models/kernel.py", set()),
        ("simulation/kernel.py", {"models"}),
        ("models/constants.py", {"models", "simulation"}),
    ],
)
def test_a_change_forgets_the_kernels_that_can_hold_it(package: Path, changed: str, left: set[str]) -> None:
    forget_older_kernels(package)
    compile_kernels(package)
    with (package / changed).open("a") as source:
        source.write("# changed\n")
    forget_older_kernels(package)
    assert kernels(package) == left


def test_constants_that_a_kernel_reads_count(package: Path) -> None:
    (package / "models" / "kernel.py").write_text(
        "from idm_sumo.models import constants\n@njit(cache=True)\ndef k(): 1\n"
    )
    forget_older_kernels(package)
    compile_kernels(package)
    (package / "models" / "constants.py").write_text("VALUE = 2\n")
    forget_older_kernels(package)
    assert kernels(package) == set()


def test_a_damaged_mark_forgets_everything(package: Path) -> None:
    forget_older_kernels(package)
    compile_kernels(package)
    (package / "__pycache__" / SOURCES).write_text("[]")
    forget_older_kernels(package)
    forget_older_kernels(package)
    assert kernels(package) == set()


def test_equal_sources_have_one_name_wherever_they_stand(package: Path, tmp_path: Path) -> None:
    moved = package.rename(tmp_path / "elsewhere")
    before = fingerprint(moved)
    (moved / "analysis" / "kernel.py").write_text("no room of ours\n")
    assert fingerprint(moved) == before
    (moved / "models" / "kernel.py").rename(moved / "models" / "other.py")
    assert fingerprint(moved) != before


def test_a_read_only_package_keeps_its_kernels_by_version_in_the_users_cache(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv(NUMBA_CACHE, raising=False)
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != package)
    find_places_for_caches(package)
    assert os.environ[NUMBA_CACHE] == str(tmp_path / "cache" / "idm-sumo" / f"kernels-{fingerprint(package)}")
    monkeypatch.delenv(NUMBA_CACHE)


ROOT = Path(__file__).parents[2]


# The superuser may write anything; without these capabilities permissions hold for it, too.
BOUND = ["setpriv", "--bounding-set=-dac_override,-dac_read_search", "--inh-caps=-dac_override,-dac_read_search"]


@pytest.mark.skipif(os.name != "posix", reason="needs permissions")
def test_a_read_only_installation_without_a_writable_home(tmp_path: Path) -> None:
    bound = BOUND if os.getuid() == 0 else []
    if bound and not shutil.which("setpriv"):
        pytest.skip("the superuser may write anywhere, and there is no setpriv")
    installed, home, temporary = (tmp_path / name for name in ("installed", "home", "tmp"))
    ignored = shutil.ignore_patterns("__pycache__", "*.nb[ic]")
    shutil.copytree(ROOT / "idm_sumo", installed / "idm_sumo", ignore=ignored)
    home.mkdir()
    temporary.mkdir()
    for folder in (home, *(path for path in installed.rglob("*") if path.is_dir())):
        folder.chmod(0o555)
    script = (
        "import numpy as np, numba\n"
        "from idm_sumo.models import bicycle, idm, laws\n"
        "from idm_sumo.roads import road\n"
        "print(numba.config.CACHE_DIR)\n"
    )
    environ = {"PATH": os.environ["PATH"], "HOME": str(home), "TMPDIR": str(temporary), "PYTHONPATH": str(installed)}
    done = subprocess.run(
        [*bound, sys.executable, "-c", script], env=environ, capture_output=True, text=True, cwd="/", check=False
    )
    for folder in (home, *(path for path in installed.rglob("*") if path.is_dir())):
        folder.chmod(0o755)
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()).parent == temporary / f"idm-sumo-{os.getuid()}"


def test_a_folder_that_somebody_else_made_is_not_trusted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(environment.tempfile, "tempdir", str(tmp_path))
    own = environment.temporary_cache()
    assert own == environment.temporary_cache()
    own.chmod(0o777)  # now anybody could have put compiled code there
    assert environment.temporary_cache() != own


def test_the_command_line_gives_blas_one_thread_before_numpy_loads() -> None:
    script = (
        "import contextlib, io, sys\n"
        "from idm_sumo.cli import main\n"
        "assert 'numpy' not in sys.modules\n"
        "with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()): main(['--help'])\n"
        "import numpy, threadpoolctl\n"
        "print({one['num_threads'] for one in threadpoolctl.threadpool_info() if one['user_api'] == 'blas'})\n"
    )
    environ = {name: value for name, value in os.environ.items() if name not in environment.BLAS_THREADS}
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, env=environ, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "{1}", done.stderr
