"""Calls spread over processes and over a dask cluster: nothing is lost, and nothing differs."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.reproduce.agents.variants import variants
from analysis.reproduce.settings import Settings
from idm_sumo.cli import main
from idm_sumo.irl.variants import VARIANTS
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.spread import ATTEMPTS, Failed, gathered, spread
from tests.helpers.cluster import doubled, free_address, killed_at_first, lasting, runs, scheduler, until, who, worker
from tests.helpers.platoons import platoon_recording

WINDOW = ("--observed", "10", "--horizon", "40")
TWO_UPDATES = 12_800  # environment steps of an agent: the rate falls to zero, so that one update alone changes nothing


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A scheduler with two workers."""
    pytest.importorskip("distributed")
    folder, address = tmp_path_factory.mktemp("cluster"), free_address()
    with ExitStack() as stack:
        stack.enter_context(scheduler(address, folder))
        for _ in range(2):
            stack.enter_context(worker(address, folder))
        until(lambda: workers_of(address) == 2)
        yield address


def workers_of(address: str) -> int:
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        return len(client.nthreads())


def test_calls_that_belong_together_fail_together_and_at_once(tmp_path: Path) -> None:
    counted: list[int] = []
    assert gathered(doubled, [(1,), ("ab",)], jobs=2, done=counted.append) == [2, "abab"]
    assert counted == [1, 2]
    with pytest.raises(InputError, match="TypeError"):
        gathered(lasting, [(tmp_path, None), (tmp_path, 60.0)], jobs=2)
    (begun,) = tmp_path.iterdir()
    until(lambda: not runs(int(begun.name)))


def results(*calls: tuple[object, ...], function: object = doubled, **how: object) -> list[object]:
    """Return the results in the order of the calls."""
    return [one for _, one in sorted(spread(function, calls, **how), key=lambda pair: pair[0])]  # type: ignore[arg-type]


def test_no_call_is_no_work() -> None:
    assert list(spread(doubled, [], jobs=4)) == []
    assert list(spread(doubled, [], cluster="tcp://127.0.0.1:1")) == []


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_call_is_computed_once_and_one_that_fails_says_why(jobs: int) -> None:
    got = results((1,), (None,), ("ab",), jobs=jobs)
    assert got[0::2] == [2, "abab"]
    assert isinstance(got[1], Failed)
    assert "TypeError" in got[1].reason


def test_a_killed_process_takes_no_call_with_it(tmp_path: Path) -> None:
    calls = [(tmp_path, number) for number in range(5)]
    assert results(*calls, function=killed_at_first, jobs=2) == list(range(5))
    assert len(list(tmp_path.glob("killed-*"))) == 1


def test_a_call_that_kills_its_process_every_time_fails_alone(tmp_path: Path) -> None:
    calls = [(tmp_path, number, 99) for number in range(3)]
    got = results(*calls, function=killed_at_first, jobs=2)
    assert got[0::2] == [0, 2]
    assert isinstance(got[1], Failed)
    assert "memory" in got[1].reason
    assert len(list(tmp_path.glob("killed-*"))) == ATTEMPTS


def test_a_cluster_computes_the_same_with_all_its_workers(cluster: str) -> None:
    assert results((1,), ("ab",), cluster=cluster) == [2, "abab"]
    assert len(set(results(*((number,) for number in range(6)), function=who, cluster=cluster))) == 2


def test_nothing_listens(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    for address in (free_address(), "nonsense"):
        with pytest.raises(InputError, match="no dask scheduler answers there") as caught:
            list(spread(doubled, [(1,)], cluster=address))
        assert "\n" not in str(caught.value)


def test_a_scheduler_without_workers(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    address = free_address()
    with scheduler(address, tmp_path), pytest.raises(InputError, match="has no workers"):
        list(spread(doubled, [(1,)], cluster=address))


def test_a_worker_of_another_version_is_refused_by_name(cluster: str, tmp_path: Path) -> None:
    with worker(cluster, tmp_path, older=True):
        until(lambda: workers_of(cluster) == 3)
        with pytest.raises(InputError, match=r"worker tcp://127\.0\.0\.1:\d+ has idm-sumo 0\.1\.0 "):
            list(spread(doubled, [(1,)], cluster=cluster))
    until(lambda: workers_of(cluster) == 2)


def test_without_the_extra_one_line_says_what_to_install() -> None:
    code = """if True:
        import sys
        sys.modules["distributed"] = None
        from idm_sumo.runtime.spread import spread
        list(spread(abs, [(1,)], cluster="tcp://127.0.0.1:1"))
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "InputError: --cluster needs dask.distributed; `pip install 'idm-sumo[cluster]'`" in done.stderr


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files of a data set, but for its manifest with times of day."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path != folder / "_manifest.json"
    }


def test_recordings_give_the_same_bytes_by_one_process_and_by_a_cluster(cluster: str, tmp_path: Path) -> None:
    for number in range(3):
        (folder := tmp_path / f"{number}").mkdir()
        platoon_recording(periods=1, platoons=2, seed=number).to_parquet(folder / "r.parquet")
    given = [str(tmp_path / f"{number}") for number in range(3)]
    main(["calibrate", *given, *WINDOW, "-o", str(tmp_path / "here")])
    main(["calibrate", *given, *WINDOW, "--cluster", cluster, "-o", str(tmp_path / "there")])
    assert contents(tmp_path / "there") == contents(tmp_path / "here")


def test_a_closed_loop_gives_the_same_tables_by_one_process_and_by_a_cluster(
    cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    platoon_recording(periods=1, platoons=2).to_parquet(tmp_path / "r.parquet")
    monkeypatch.chdir(tmp_path)  # workers have other current folders
    loop = ["interactive", "r.parquet", "--types", "krauss", "--types", "default-idm", "--seeds", "2"]
    loop += ["--replay-bias", "0", "--jobs", "1"]
    main([*loop, "-o", "here"])
    main([*loop, "--cluster", cluster, "-o", "there"])
    here, there = (contents(tmp_path / name) for name in ("here", "there"))
    assert sorted(there) == sorted(here)
    assert "fcd/krauss-seed2.parquet" in there
    for name in here:
        if name.startswith(("tables/", "figures/")):
            assert there[name] == here[name], name
    assert "cluster" not in json.loads(there["manifest.json"])["settings"]


def test_agents_are_the_same_by_processes_and_by_a_cluster(cluster: str, tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3", reason="needs the extra rl: pip install 'idm-sumo[rl]'")
    platoon_recording().to_parquet(tmp_path / "r.parquet")
    train = ["irl", "train", str(tmp_path / "r.parquet"), "--seeds", "2", "--agent-steps", str(TWO_UPDATES)]
    main([*train, "-o", str(tmp_path / "here")])
    main([*train, "--cluster", cluster, "-o", str(tmp_path / "there")])
    here, there = (contents(tmp_path / name) for name in ("here", "there"))
    assert sorted(there) == sorted(here)
    for name in here:
        if name.endswith((".json", ".npz")):
            assert there[name] == here[name], name


def test_variants_of_the_reward_are_the_same_by_one_process_and_by_a_cluster(
    cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("stable_baselines3", reason="needs the extra rl: pip install 'idm-sumo[rl]'")
    platoon_recording().to_parquet(tmp_path / "r.parquet")
    settings = Settings(recordings=(str(tmp_path / "r.parquet"),), agent_steps=TWO_UPDATES, agent_seeds=1)
    which = [replace(VARIANTS[number], demonstrations=2) for number in (0, 4)]  # with a penalty, and without
    table = variants(settings, tmp_path / "there.csv", which=which, cluster=cluster)
    monkeypatch.setattr("analysis.reproduce.agents.variants.cpu_count", lambda: 1)
    variants(settings, tmp_path / "here.csv", which=which)
    assert table["ade_m"].nunique() == len(which)  # so that a row in another's place shows
    assert (tmp_path / "there.csv").read_bytes() == (tmp_path / "here.csv").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["here.csv", "r.parquet", "there.csv"]


# The last of this module: of the cluster one worker is left.
def test_a_killed_worker_loses_nothing(cluster: str, tmp_path: Path) -> None:
    calls = [(tmp_path, number) for number in range(4)]
    assert results(*calls, function=killed_at_first, cluster=cluster) == list(range(4))
    assert workers_of(cluster) == 1
