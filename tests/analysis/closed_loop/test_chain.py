"""From calibrated and predicted drivers to SUMO types and a closed loop, without a flag; v0 goes with them."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import parse

import numpy as np
import pandas as pd
import pytest

from idm_sumo.calibration.drawn import DRAWN
from idm_sumo.calibration.parameter_sets import POOLED
from idm_sumo.calibration.whole import OTHER_LAWS
from idm_sumo.cli import main
from idm_sumo.cli.options import LAWS
from idm_sumo.models import idm
from tests.helpers.exports import read_types, sumo

V0 = 21.0  # m/s, unlike any limit


@pytest.fixture(scope="module")
def drivers(platoons: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("chain") / "drivers.parquet"
    main(["calibrate", str(platoons), "--horizon", "60", "--desired-speed", str(V0), "-o", str(path)])
    return path


def exported(table: Path, folder: Path, *options: str) -> pd.DataFrame:
    """Export a driver table; return its types' numbers by name."""
    routes = folder / "fleet.rou.xml"
    main(["export", str(table), "--no-check", *options, "-o", str(routes)])
    names = ("accel", "decel", "tau", "minGap", "maxSpeed")
    types = read_types(routes)
    return pd.DataFrame({name: {key: float(one.attrib[name]) for key, one in types.items()} for name in names})


@pytest.mark.parametrize("method", ["knn", "rollout", "residual"])
def test_predicted_drivers_go_into_export_and_a_closed_loop(
    platoons: Path, drivers: Path, tmp_path: Path, method: str
) -> None:
    predicted = tmp_path / "predicted.parquet"
    main(["predict", str(platoons), "--method", method, "--drivers", str(drivers), "-o", str(predicted)])
    table = pd.read_parquet(predicted)
    assert np.allclose(table["desired_speed_m_s"], V0)
    types = exported(predicted, tmp_path)
    assert len(types) == len(table)
    assert (types["maxSpeed"] == V0).all()
    main(["interactive", str(platoons), "--drivers", str(predicted), "-o", str(tmp_path / "loop")])
    loop = pd.read_csv(tmp_path / "loop" / "tables" / "closed_loop.csv")
    assert {"recorded", "drivers", "pooled"} <= set(loop["population"])
    has_residuals = "residual_model" in table and (table["residual_model"] != "population").any()
    assert ("residual" in set(loop["population"])) == has_residuals == (method == "residual")
    kinds = parse(tmp_path / "loop" / "simulation" / "drivers.rou.xml").getroot().findall("vType")
    assert {float(kind.attrib["maxSpeed"]) for kind in kinds} == {V0}


def test_drawn_parameters_are_exported_unless_others_are_asked_for(drivers: Path, tmp_path: Path) -> None:
    table = pd.read_parquet(drivers)
    usual, drawn, fitted, pooled = (
        exported(drivers, tmp_path, *options)
        for options in ((), *(("--parameters", one) for one in ("drawn", "fitted", "pooled")))
    )
    pd.testing.assert_frame_equal(usual, drawn)
    assert sorted(usual["accel"]) == pytest.approx(sorted(table[DRAWN[0]]))
    assert sorted(fitted["accel"]) == pytest.approx(sorted(table["a_refit"]))
    assert set(pooled["accel"]) == set(table[POOLED[0]])
    assert table[POOLED].nunique().eq(1).all()


def test_the_command_line_has_the_laws_that_drivers_are_fitted_by() -> None:
    assert OTHER_LAWS == LAWS


@pytest.mark.parametrize(("law", "model"), [("krauss", "Krauss"), ("eidm", "EIDM")])
def test_types_by_another_law_are_fitted_and_their_price_is_said(
    platoons: Path, drivers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], law: str, model: str
) -> None:
    with pytest.raises(SystemExit, match="2"):
        exported(drivers, tmp_path, "--law", law)
    assert f"`idm-sumo calibrate --law {law}`" in capsys.readouterr().err
    both = tmp_path / "both.parquet"
    main(["calibrate", str(platoons), "--horizon", "60", "--law", law, "-o", str(both)])
    table = pd.read_parquet(both).dropna(subset=f"{law}_ade_m")
    assert (table[f"{law}_ade_m"] > 0.0).all()
    capsys.readouterr()
    types = exported(both, tmp_path, "--law", law)
    said = capsys.readouterr().err
    assert re.search(law + r": \d+\.\d\d m from the recording on average over all windows, the IDM \d+\.\d\d m", said)
    assert len(types) == len(table)
    kinds = read_types(tmp_path / "fleet.rou.xml").values()
    assert {kind.attrib["carFollowModel"] for kind in kinds} == {model}
    assert all(kind.attrib[name] == "0" for kind in kinds for name in kind.attrib if name.startswith("sigma"))
    assert sumo(tmp_path / "fleet.sumocfg", "--end", "60").returncode == 0  # with SUMO's schemas
    own = set(types["accel"]) & set(table[f"a_{law}"])
    assert own
    bounds = {float(bound) for bound in (idm.LOWER.a, idm.UPPER.a)}
    assert not own & bounds
    with pytest.raises(SystemExit, match="2"):
        exported(both, tmp_path, "--law", law, "--parameters", "drawn")
    assert "leave out --parameters" in capsys.readouterr().err
    loop = [
        "interactive",
        str(platoons),
        "--drivers",
        str(both),
        "--types",
        "drawn",
        "--law",
        law,
        "--replay-bias",
        "0",
    ]
    main([*loop, "--jobs", "1", "-o", str(tmp_path / "loop")])
    result = pd.read_csv(tmp_path / "loop" / "tables" / "closed_loop.csv")
    assert result["population"].tolist() == ["recorded", "drawn", f"fitted-{law}"]
    kinds = read_types(tmp_path / "loop" / "simulation" / f"fitted-{law}.rou.xml").values()
    assert {kind.attrib["carFollowModel"] for kind in kinds} == {model}
    assert own & {float(kind.attrib["accel"]) for kind in kinds}
