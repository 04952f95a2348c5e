"""What blind trials add up to: power, confusion, false alarms, magnitude, coverage and gain, with their counts."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from scipy import stats

from analysis.page.style import save
from idm_sumo.models.effects import CATALOGUE
from tests.simulators.campaign.figures import at_a_glance
from tests.simulators.campaign.scores import GAIN_CLASSES, RIGHT, RIGHT_AND_MORE, SILENT, scored, sized

CONDITIONS = ("underlying", "noise", "sigma", "form", "density", "lanes")
GOOD = (RIGHT, RIGHT_AND_MORE)
PRESENT = ("missed", "missed_present", "present_not_hidden")
PICTURE = "Each single effect by what it is worth and whether it was named, and found against hidden sizes"
EXPLAINED = {
    "Groups": "Right: the hidden cause is named first (none: nothing is said; outside: `unknown`, where it shows).",
    "False alarms": "Recordings with nothing planted.",
    "Power by achievable gain": "Single effects by what the true model, refitted, is better by (share of ADE).",
    "Power": "Single effects; last two columns: medians of the true model's gain and of the extended model's.",
    "Confusion": "Rows: hidden. Columns: named first, or the verdict.",
    "Power by car-following": "The same by the car-following underneath, and by the form of the effect.",
    "Laws": "Rows: the car-following underneath. Columns: the law that was taken for it.",
    "In SUMO": "One effect on the headway, large, in traffic that SUMO's own car-following drives.",
    "Pairs by what the lesser is worth": "Two effects at once, by what the lesser gains with the other in the model.",
    "Pairs": "Two effects at once.",
    "Present without gain": "Effects: hidden and not named; of these, present without gain; said so and not hidden.",
    "Outside": "Effects that the catalogue does not hold.",
    "Conditions": "Single effects.",
    "Magnitudes": "Relative error of named sizes, single or in a pair; how often the 95 % interval holds the truth.",
    "Magnitudes by effect": "The same where the effect has the catalogue's form.",
    "Gain realised": "Gain on held-out drivers over the true model's, where the cause was named and that gains 2 % or "
    "more. A wish to change "
    "lanes, which the true model knows of, shows in a recording only where it was carried out.",
    "Timing": "Wall seconds a recording.",
}


def summarise(trials: pd.DataFrame, folder: Path) -> None:
    """Write every table and the picture of a campaign into ``folder``; one row of ``trials`` a recording."""
    graded = scored(trials)
    graded.round(3).to_csv(folder / "trials.csv", index=False)
    lines = [
        "# Blind trials of `diagnose`",
        "",
        f"{len(graded)} recordings. Intervals are exact (Clopper-Pearson), 95 %.",
    ]
    sizes = sized(trials)
    sizes.round(4).to_csv(folder / "sizes.csv", index=False)
    for title, table in tables(graded, sizes).items():
        if table.empty:
            continue
        table.to_csv(folder / f"{title.lower().replace(' ', '_')}.csv", index=False)
        lines += ["", f"## {title}", "", EXPLAINED[title], "", _markdown(table)]
    if graded.loc[graded["group"] == "single", "best_gain"].notna().any():
        save(at_a_glance(graded, sizes), folder / "at_a_glance.png")
        lines[3:3] = ["", f"![{PICTURE}](at_a_glance.png)"]
    (folder / "README.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def tables(graded: pd.DataFrame, sizes: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the tables by their titles; ``sizes`` of :func:`~tests.simulators.campaign.scores.sized`."""
    single, none = graded[graded["group"] == "single"], graded[graded["group"] == "none"]
    pairs, usual = graded[graded["group"] == "pair"], sizes[sizes["form"] == "usual"]
    power = counts(single, ["name", "size"])
    if len(power):
        medians = single.groupby(["name", "size"], sort=False)[["best_gain", "gain"]].median().round(3).reset_index()
        power = power.merge(medians, on=["name", "size"])
        power = power.sort_values("name", kind="stable", ignore_index=True)
    return {
        "Groups": counts(graded, ["group"]),
        "False alarms": pd.concat([counts(none.assign(kind="all"), ["kind"]), counts(none, ["kind"]),
                                   counts(none, ["underlying"]).rename(columns={"underlying": "kind"})]),
        "Power by achievable gain": counts(single, ["gain_class"], order=GAIN_CLASSES),
        "Power by car-following": _by(single, ("underlying", "form"), ("gain_class",)),
        "Power": power,
        "Confusion": confusion(graded),
        "Laws": laws(graded),
        "In SUMO": _by(graded[graded["group"] == "in SUMO"], ("name", "underlying")),
        "Pairs by what the lesser is worth": counts(pairs, ["lesser_class"], order=GAIN_CLASSES),
        "Pairs": pd.concat([counts(pairs, ["name"]),
            counts(pairs, ["underlying"]).rename(columns={"underlying": "name"})]),
        "Present without gain": graded.groupby("group", sort=False)[list(PRESENT)].sum().reset_index(),
        "Outside": counts(graded[graded["group"] == "outside"], ["name"]),
        "Conditions": _by(single, CONDITIONS),
        "Magnitudes": pd.concat([
            magnitudes(one, ["form", "underlying"]) for one in (sizes.assign(underlying="all"), sizes)
        ]),
        "Magnitudes by effect": magnitudes(usual, ["name"]),
        "Gain realised": pd.concat([
            realised(graded.assign(size="all"), "size"), realised(graded.assign(of=_hangs_on(graded["name"])), "of"),
            realised(graded, "size"), realised(graded, "underlying"),
        ]),
        "Timing": graded["seconds"].describe()[["count", "min", "50%", "max"]].round(1).to_frame().T,
    }  # fmt: skip


def counts(graded: pd.DataFrame, keys: list[str], order: tuple[str, ...] = ()) -> pd.DataFrame:
    """Return how often each outcome came, and the share that was as it should be with its exact 95 % interval."""
    if graded.empty:
        return pd.DataFrame()
    table = graded.groupby([*keys, "outcome"], sort=False).size().unstack(fill_value=0)
    if order:
        table = table.reindex([one for one in order if one in table.index])
    fine = graded["outcome"].isin(GOOD) | ((graded["group"] == "none") & (graded["outcome"] == SILENT))
    good = fine.groupby([graded[key] for key in keys], sort=False).sum().reindex(table.index)
    total = table.sum(axis=1)
    intervals = [
        stats.binomtest(int(g), int(n)).proportion_ci(method="exact") for g, n in zip(good, total, strict=True)
    ]
    table["recordings"], table["good"] = total, (good / total).round(3)
    table["ci95"] = [f"{one.low:.2f}-{one.high:.2f}" for one in intervals]
    return table.reset_index()


def confusion(graded: pd.DataFrame) -> pd.DataFrame:
    """Return what was said first (columns) of what was hidden (rows)."""
    some = graded[graded["group"].isin(["none", "single", "outside", "some drivers", "one lane", "in SUMO"])]
    if some.empty:
        return pd.DataFrame()
    return pd.crosstab(some["name"], some["first"]).reset_index().rename(columns={"name": "hidden"})


def laws(graded: pd.DataFrame) -> pd.DataFrame:
    """Return which law (columns) was taken for the car-following underneath (rows), if that is known."""
    known = graded[graded["law"].notna()]
    return pd.crosstab(known["underlying"], known["law"]).reset_index() if len(known) else pd.DataFrame()


def _by(graded: pd.DataFrame, conditions: tuple[str, ...], more: tuple[str, ...] = ()) -> pd.DataFrame:
    """Return the counts under each condition in turn, in columns ``of`` and ``condition``."""
    each = [graded.assign(of=key, condition=graded[key].astype(str)) for key in conditions]
    return pd.concat([counts(one, ["of", "condition", *more]) for one in each])


def magnitudes(sizes: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """Return relative errors of the estimated sizes and how often the interval holds the planted one."""
    if sizes.empty:
        return pd.DataFrame()
    sizes = sizes.assign(ratio=sizes["estimate"] / sizes["planted"], covered=sizes["covered"].astype(float))
    grouped = sizes.groupby(keys)
    out = pd.DataFrame({
        "median error": grouped["error"].median(), "90 % of errors below": grouped["error"].quantile(0.9),
        "median found / planted": grouped["ratio"].median(), "interval holds it": grouped["covered"].mean(),
        "found": grouped.size(),
    })  # fmt: skip
    return out.round(3).reset_index()


def _hangs_on(names: pd.Series) -> pd.Series:
    """Return whether effects hang on somebody's wish to change lanes."""
    return names.str.contains("|".join(effect.name for effect in CATALOGUE if effect.hindsight)).map(
        {True: "a lane change to come", False: "no wish"}
    )


def realised(graded: pd.DataFrame, key: str) -> pd.DataFrame:
    """Return the gain on held-out drivers over the true model's."""
    known = graded[graded["outcome"].isin((*GOOD, "one of two"))].dropna(subset=["realised"])
    if known.empty:
        return pd.DataFrame()
    grouped = known.groupby(known[key].rename("of"), sort=False)["realised"]
    quartiles = grouped.quantile([0.25, 0.5, 0.75]).unstack()
    quartiles.columns = pd.Index(["lower quartile", "median", "upper quartile"])
    return quartiles.assign(recordings=grouped.size()).round(3).reset_index()


def _markdown(table: pd.DataFrame) -> str:
    whole = table.apply(lambda one: one.astype("Int64").astype(str).replace("<NA>", "0") if _is_count(one) else one)
    head = "| " + " | ".join(map(str, whole.columns)) + " |"
    rule = "|" + "---|" * len(whole.columns)
    rows = ["| " + " | ".join(str(value) for value in row) + " |" for row in whole.itertuples(index=False)]
    return "\n".join([head, rule, *rows])


def _is_count(column: pd.Series) -> bool:
    """Whether a column holds counts (tables put together leave NaN where an outcome never came)."""
    return bool(pd.api.types.is_float_dtype(column) and column.isna().any() and (column.dropna() % 1 == 0).all())
