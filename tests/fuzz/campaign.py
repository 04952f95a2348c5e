"""Read malformed inputs of every kind and judge how each ends."""

from __future__ import annotations

import json
import random
import shutil
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from analysis.reproduce.agents.learners import read_curve, read_reward
from analysis.reproduce.settings import load_settings
from idm_sumo.calibration.driver_table import read_drivers
from idm_sumo.irl.policy import Policy
from idm_sumo.models.effects import ExtendedModel
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.own_network import road_of
from idm_sumo.sumo.own_recording import read_on_network
from tests.fuzz import mutate, seeds

SLOW = 30.0  # s of computing that no small input may take
LONGEST = 700  # characters of a message, the program's name before it


class Kind(NamedTuple):
    """How inputs of one kind are made, named and read."""

    name: str
    make: Callable[[random.Random], bytes]
    read: Callable[[Path], Any]


def _recording(path: Path) -> None:
    smooth(clean(read_recording(path)))


def _xml(draw: random.Random) -> bytes:
    table, steps = seeds.fcd(), []
    for now, rows in table.groupby("timestep_time"):
        cars = "".join(
            f'<vehicle id="{r.vehicle_id}" x="{r.vehicle_x}" y="{r.vehicle_y}" angle="90" speed="{r.vehicle_speed}" '
            f'lane="{r.vehicle_lane}"/>'
            for r in rows.itertuples()
        )
        steps.append(f'<timestep time="{now:.2f}">{cars}</timestep>')
    data = f'<?xml version="1.0" encoding="UTF-8"?>\n<fcd-export>{"".join(steps)}</fcd-export>'
    old = draw.choice(("car.1", "12.192", "entry_3", "UTF-8", 'angle="90"', "fcd-export", "</timestep>", "90"))
    bad = draw.choice(mutate.CELLS).replace("\x00", "")
    changed = data.replace(old, bad, draw.choice((1, -1))).encode("utf-8", "replace")
    return mutate.of_bytes(changed, draw) if draw.random() < 0.3 else changed


def _openacc(draw: random.Random) -> bytes:
    before = draw.choice((b"#Location,track\n#Vehicles,2\n#Length,4.6\n", b"#Location\n", b"#Length,x\n", b""))
    return before + mutate.of_text_table(seeds.openacc(), draw, ",")


def _beside_highd(path: Path) -> None:
    """Read sound tracks with a malformed file beside them."""
    beside = path.parent / "beside"
    beside.mkdir(exist_ok=True)
    for old in beside.iterdir():
        old.unlink()
    shutil.copy(path, beside / path.name)
    seeds.highd().to_csv(beside / "07_tracks.csv", index=False)
    _recording(beside / "07_tracks.csv")


def _xml_on_network(draw: random.Random) -> bytes:
    steps = "".join(
        f'<timestep time="{r.timestep_time:.2f}">\n<vehicle id="{r.vehicle_id}" x="{r.vehicle_x}" y="{r.vehicle_y}" '
        f'angle="90" type="truck" speed="20" pos="{r.vehicle_pos}" lane="{r.vehicle_lane}"/>\n</timestep>\n'
        for r in seeds.fcd_on_network().itertuples()
    )
    return mutate.of_xml(f"<fcd-export>\n{steps}</fcd-export>", draw)


def _on_network(path: Path, *, net: Path = seeds.NETWORK, types: tuple[Path, ...] = ()) -> None:
    smooth(clean(read_on_network(path, net, route_files=types, location="us-101")))


def _beside_network(path: Path, **given: Any) -> None:
    """Read sound floating car data with a malformed file beside them."""
    sound = path.parent / "sound_fcd.csv"
    if not sound.is_file():
        seeds.fcd_on_network().to_csv(sound, sep=";", index=False)
    _on_network(sound, **given)


def _network_text() -> str:
    return seeds.NETWORK.read_text(encoding="utf-8")


KINDS = (
    Kind("official.txt", lambda d: mutate.of_text_table(seeds.ngsim(), d, " ", header=False), _recording),
    Kind("portal.csv", lambda d: mutate.of_text_table(seeds.ngsim(), d, ","), _recording),
    Kind("ngsim.parquet", lambda d: mutate.of_parquet(seeds.ngsim(), d), _recording),
    Kind("own.csv", lambda d: mutate.of_text_table(seeds.own(), d, ","), _recording),
    Kind("own.parquet", lambda d: mutate.of_parquet(seeds.own(), d), _recording),
    Kind("fcd.xml", _xml, _recording),
    Kind("fcd.csv", lambda d: mutate.of_text_table(seeds.fcd(), d, ";"), _recording),
    Kind("fcd.parquet", lambda d: mutate.of_parquet(seeds.fcd(), d), _recording),
    Kind("network_fcd.xml", _xml_on_network, _on_network),
    Kind("network_fcd.csv", lambda d: mutate.of_text_table(seeds.fcd_on_network(), d, ";"), _on_network),
    Kind("network_fcd.parquet", lambda d: mutate.of_parquet(seeds.fcd_on_network(), d), _on_network),
    Kind("own.net.xml", lambda d: mutate.of_xml(_network_text(), d), lambda path: _beside_network(path, net=path)),
    Kind("types.rou.xml", lambda d: mutate.of_xml(seeds.types(), d), lambda path: _beside_network(path, types=(path,))),
    Kind(
        "corridor.json",
        lambda d: mutate.of_corridor(seeds.corridor(), d),
        lambda path: road_of(seeds.NETWORK, json.loads(path.read_bytes())),
    ),
    Kind("pairs.csv", lambda d: mutate.of_text_table(seeds.pairs(), d, ","), _recording),
    Kind("pairs.parquet", lambda d: mutate.of_parquet(seeds.pairs(), d), _recording),
    Kind("drivers.csv", lambda d: mutate.of_text_table(seeds.drivers(), d, ","), read_drivers),
    Kind("drivers.parquet", lambda d: mutate.of_parquet(seeds.drivers(), d), read_drivers),
    Kind("model.json", lambda d: mutate.of_json(seeds.model(), d), ExtendedModel.read),
    Kind("run.toml", lambda d: mutate.of_toml(seeds.run_file(), d), lambda path: load_settings(path, {})),
    Kind("named_pairs.csv", lambda d: mutate.of_text_table(seeds.named_pairs(), d, ","), _recording),
    Kind("07_tracks.csv", lambda d: mutate.of_text_table(seeds.highd(), d, ","), _recording),
    Kind("07_tracksMeta.csv", lambda d: mutate.of_text_table(seeds.highd_meta(), d, ","), _beside_highd),
    Kind("07_recordingMeta.csv", lambda d: mutate.of_text_table(seeds.highd_meta(), d, ","), _beside_highd),
    Kind("exid.csv", lambda d: mutate.of_text_table(seeds.exid(), d, ","), _recording),
    Kind("tgsim.csv", lambda d: mutate.of_text_table(seeds.tgsim(), d, ","), _recording),
    Kind("openacc.csv", _openacc, _recording),
    Kind("i24.json", lambda d: mutate.of_json(seeds.i24(), d), _recording),
    Kind("street.txt", lambda d: mutate.of_text_table(seeds.street(), d, " ", header=False), _recording),
    Kind("reconstructed.txt", lambda d: mutate.of_text_table(seeds.reconstructed(), d, " ", header=False), _recording),
    Kind("reward.json", lambda d: mutate.of_json(seeds.reward(), d), read_reward),
    Kind("irl_rl-seed1.csv", lambda d: mutate.of_text_table(seeds.curve(), d, ","), read_curve),
    Kind("policy.npz", lambda d: mutate.of_arrays(seeds.policy(), d), Policy.load),
)


def judge(kind: Kind, path: Path) -> tuple[str, str]:
    """Return how reading one file ends, ``sound``, ``refused`` or ``fault``, and what was wrong."""
    start = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            kind.read(path)
    except InputError as error:
        if len(str(error)) > LONGEST or not str(error).isprintable():
            return "fault", f"message: {str(error)[:80]!r}"
        end = "refused"
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        ours = next((f for f in reversed(frames) if "site-packages" not in f.filename), frames[-1])
        return "fault", f"{type(error).__name__} at {Path(ours.filename).name}:{ours.lineno}: {str(error)[:100]!r}"
    else:
        end = "sound"
    seconds = time.process_time() - start
    return (end, "") if seconds < SLOW else ("fault", f"took {seconds:.0f} s")


def campaign(
    folder: Path, runs: int, seed: int = 0, kinds: tuple[Kind, ...] = KINDS
) -> list[tuple[str, str, str, int]]:
    """Read ``runs`` inputs of each kind; return kind, end, fault and number of each, and keep the faulty inputs."""
    out = []
    for kind in kinds:
        for number in range(runs):
            draw = random.Random(f"{kind.name} {seed} {number}")
            path = folder / kind.name
            path.write_bytes(kind.make(draw))
            end, fault = judge(kind, path)
            out.append((kind.name, end, fault, number))
            if fault:
                path.rename(folder / f"{number}-{kind.name}")
    return out
