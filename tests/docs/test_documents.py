"""The documents agree with the code, with each other and with the kept trials."""

import argparse
import re
from pathlib import Path

import pandas as pd
import pytest

import idm_sumo
from idm_sumo.cli.parser import build_parser
from idm_sumo.models.effects import CATALOGUE

ROOT = Path(__file__).parents[2]
TRIALS = ROOT / "tests/simulators/campaign/results"
RIGHT = ("right", "right and more")


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def table(name: str) -> dict[str, list[str]]:
    """Return the rows of a page's tables by their first cell."""
    rows = [line.strip("|").split(" | ") for line in text(name).splitlines() if line.startswith("| ")]
    return {row[0].strip(" `"): [cell.strip() for cell in row[1:]] for row in rows}


def test_the_readme_is_short_and_sets_up_with_two_commands() -> None:
    readme = text("README.md")
    assert len(readme.split()) < 900
    assert len(re.findall(r"^```sh\n[^\n]+\n```$", readme, flags=re.MULTILINE)) == readme.count("```sh") == 2


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md"])
def test_links_of_documents_outside_the_site_lead_to_files(name: str) -> None:
    links = re.findall(r"\]\(([^)#]+)", text(name))
    lost = [link for link in links if not link.startswith("https://") and not (ROOT / link).exists()]
    assert not lost


def test_the_version_is_the_same_everywhere() -> None:
    assert f"\nversion: {idm_sumo.__version__}\n" in text("CITATION.cff")
    assert f"\n## [{idm_sumo.__version__}] - " in text("CHANGELOG.md")


def test_every_command_and_every_effect_has_its_row() -> None:
    actions = next(one for one in build_parser()._actions if isinstance(one, argparse._SubParsersAction))
    assert set(actions.choices) <= set(table("docs/commands.md"))
    assert {effect.name for effect in CATALOGUE} <= set(table("docs/effects.md"))


@pytest.mark.parametrize(("column", "simulator"), [(0, "first"), (1, "second")])
def test_counts_of_blind_trials_are_those_of_the_kept_trials(column: int, simulator: str) -> None:
    trials = pd.read_csv(TRIALS / f"{simulator}.csv")
    single = trials[trials["group"] == "single"]
    groups = {
        "nothing: silent": (trials[trials["group"] == "none"], ("silent",)),
        "one effect worth 5 % or more": (single[single["gain_class"] == "5 % or more"], RIGHT),
        "one effect worth 2 to 5 %": (single[single["gain_class"] == "2 to 5 %"], RIGHT),
        "one effect worth less": (single[single["gain_class"] == "below 2 %"], RIGHT),
        "two effects, both named": (trials[trials["group"] == "pair"], RIGHT),
        "outside the catalogue: `unknown`, where it shows": (trials[trials["group"] == "outside"], RIGHT),
        "in one lane only, named with the lane": (trials[trials["group"] == "one lane"], RIGHT),
    }
    page = table("docs/blind_results.md")
    said = {name: page[name][column].split(" (")[0].split(",")[0] for name in groups}
    assert said == {name: f"{some['outcome'].isin(good).sum()} of {len(some)}" for name, (some, good) in groups.items()}
