"""What the report says of prediction; every number in a sentence is computed."""

from __future__ import annotations

import pandas as pd

from .seconds import OWN_PAST, WATCHED

ENTRY, ALONG, IN_LANE = "entry", "every 6 s", "every 6 s, in lane"


def describe(tables: dict[str, pd.DataFrame]) -> dict[str, object]:
    """Return the sentences by their name in the template, from the tables by the name of their file."""
    numbers = tables["prediction_reasons"].set_index("what")["value"]
    share = tables["prediction_share"].set_index(["windows", "method"])
    seconds = tables["prediction_seconds"]
    return {
        "prediction_why": (
            _on_directions(numbers), _on_averaging(numbers), _on_the_code(tables["prediction_explained"]),
            _on_the_papers_gain(numbers, share),
        ),
        "prediction_limits": _on_limits(numbers, share, seconds),
        "prediction_seconds_caption": caption(seconds),
        "prediction_coverage_text": _on_coverage(tables["prediction_coverage"]),
    }  # fmt: skip


def _on_directions(n: pd.Series) -> str:
    first, second = n["flattest direction, first"], n["flattest direction, second"]
    against = "against" if n["share of drivers in whom both grow together"] < 0.5 else "with"
    return (
        f"Ten seconds determine {n['directions determined']:.1f} of the five directions in the space of the parameters (mean "
        f"over the test drivers; determined: a 95 % interval no wider than half the range between the bounds); "
        f"{n['share of directions not determined']:.0%} are open, and in "
        f"{n['share of drivers with a direction not determined']:.0%} of the drivers at least one. The flattest direction is "
        f"mostly {first} ({n['share of the flattest direction in the first']:.0%} of its square) and {second} "
        f"({n['share of the flattest direction in the second']:.0%}), traded {against} each other: where speed hardly changes, one "
        "stands for the other."
    )


def _on_averaging(n: pd.Series) -> str:
    own, average, joint, pooled = (
        n[f"{name}: ADE (m)"] for name in (
            "neighbours' own parameters, on themselves", "neighbours' average, on themselves",
            "one set fitted to the neighbours, on themselves", "pooled, on the neighbours",
        )
    )  # fmt: skip
    versus = "more" if average > pooled else "less"
    on_driver, joint_on_driver, pooled_on_driver = (
        n[f"{name}: ADE (m)"] for name in (
            "neighbours' average, on the driver", "one set fitted to the neighbours, on the driver", "pooled, on the same drivers",
        )
    )  # fmt: skip
    return (
        f"The average of the neighbours' parameters lies {n['distance of the average from the neighbours (box)']:.2f} of the box "
        f"away from each of them. A move of {n['longest move along the flattest direction (box)']:g} along the flattest direction "
        f"costs {100.0 * n['that move costs, median driver: ADE (m)']:.1f} cm of ADE (median driver); the average costs the "
        f"neighbours themselves {average - own:.2f} m: driven with it they are {average:.2f} m off, with their own parameters "
        f"{own:.2f} m, with one set fitted to their rollouts together {joint:.2f} m, and with the pooled set {pooled:.2f} m, so that "
        f"averaging costs {versus} than knowing nothing. Averaging leaves the valleys. On the drivers to be foretold the average "
        f"gives {on_driver:.2f} m, the set fitted to the same neighbours {joint_on_driver:.2f} m, pooled {pooled_on_driver:.2f} m "
        f"({n['drivers whose neighbours were looked at']:.0f} test drivers)."
    )


def _on_the_code(explained: pd.DataFrame) -> str:
    r2 = explained.set_index("parameter")["r2"].dropna()
    if r2.empty:
        return "There are too few drivers to say what the first second tells of their parameters."
    said = ", ".join(f"{max(value, 0.0):.0%} of {name}" for name, value in r2.sort_values(ascending=False).items())
    return (
        f"Of the variance of the fitted parameters the first second explains {said} in drivers left out. Where in its valley a "
        "fit ends, nothing observed can foretell."
    )


def _on_the_papers_gain(n: pd.Series, share: pd.DataFrame) -> str:
    free, drawn, pooled = (
        n[f"{name}: ADE (m)"] for name in (
            "averaged neighbours, free fits", "averaged neighbours, fits drawn to the population", "pooled, on the same windows",
        )
    )  # fmt: skip
    lanes = [f"{label} {share.loc[(kind, 'idm_prediction'), 'share']:.0%}" for kind, label in
             ((ALONG, "in all windows"), (IN_LANE, "in those without a lane change")) if (kind, "idm_prediction") in share.index]  # fmt: skip
    verdict = "still no better than" if drawn >= pooled else "better than"
    return (
        f"Where the paper's method would gain: with neighbours whose fits are drawn to the population, so that what a window does "
        f"not determine stays usual, the same averaging has an ADE of {drawn:.2f} m and not {free:.2f} m, {verdict} the pooled "
        f"{pooled:.2f} m. Its share of the way from pooled to oracle is {' and '.join(lanes)}."
    )


def _on_limits(n: pd.Series, share: pd.DataFrame, seconds: pd.DataFrame) -> str:
    along = share.loc[ALONG]["share"]
    said = [
        f"On windows all along the way the prediction closes {along['idm_rollout']:.0%} of the distance from pooled to oracle, a black "
        f"box on the same second {along['black_box_first_second']:.0%}, one that is also told where the leader will drive "
        f"{along['black_box_with_leaders_path']:.0%}."
    ]
    hindsight = "one set a driver in hindsight: share"
    if hindsight in n:
        said.append(
            f"One set for each driver, fitted in hindsight to all windows of its way, closes {n[hindsight]:.0%} "
            f"({n[hindsight + ', low']:.0%} to {n[hindsight + ', high']:.0%}, {n['drivers in hindsight']:.0f} drivers): hardly any "
            f"parameters that stay with a driver can do better, and the other {1.0 - n[hindsight]:.0%} are the same driver in another window."
        )
    own, watched = (seconds[seconds["method"] == name] for name in (OWN_PAST, WATCHED))
    if len(own):
        longest = own.iloc[-1]
        off = " (below 0: they are further off than the pooled set)" if longest["share"] < 0.0 else ""
        said.append(
            f"Of what a driver did before: parameters fitted to its own last {longest['observed_s']:g} s close "
            f"{longest['share']:.0%}{off}; weighed as learned from training drivers and added to what the last second foretells, they "
            f"close {watched.iloc[-1]['share']:.0%}."
        )
    return " ".join(said)


def caption(seconds: pd.DataFrame) -> str:
    """Say what the table of observed seconds shows."""
    watched = seconds[seconds["method"] == WATCHED].set_index("observed_s")
    if watched.empty:
        return "Nobody is recorded for long enough to be watched for longer."
    first, last = watched.loc[1.0], watched.iloc[-1]
    strength = first["strength"]
    believed = (
        f"after {watched.index[-1]:g} s {last['ade_m']:.2f} m and {last['share']:.0%} ({last['share_low']:.0%} to "
        f"{last['share_high']:.0%}), a gain of {100.0 * last['on_1s_m']:.1f} cm ({100.0 * last['on_1s_low_m']:.1f} to "
        f"{100.0 * last['on_1s_high_m']:.1f}, in pairs): by training drivers left out, the past counts {strength:g} times what independent errors would "
        "make it count."
        if strength
        else "which does not change: by training drivers left out, their past is best not believed at all."
    )
    return (
        f"ADE of what follows (left) and share of the way from pooled to oracle (right, 95 % intervals from drivers drawn anew) "
        f"against the seconds observed; {last['number']:.0f} windows of {last['drivers']:.0f} test drivers, the same in every point. "
        f"After one second {first['ade_m']:.2f} m and {first['share']:.0%} ({first['share_low']:.0%} to {first['share_high']:.0%}), "
        f"{believed}{_on_short(watched)}"
    )


def _on_short(watched: pd.DataFrame) -> str:
    shortest = watched.iloc[0]
    if watched.index[0] >= 1.0 or shortest["share"] <= watched.loc[1.0, "share"]:
        return ""
    return (
        f" That {watched.index[0]:g} s seem to be worth more than one ({shortest['share']:.0%}) is at least in part the smoothing's doing: it "
        "looks up to a second ahead, so that the rates of the last frames know a little of what follows, which a whole second averages out."
    )


def _on_coverage(coverage: pd.DataFrame) -> str:
    own = coverage[coverage["method"] == "idm_rollout"]
    said = "; ".join(
        f"{row['coverage_90%']:.1%} at {row['seconds']:g} s ({row['coverage_90%_low']:.1%} to {row['coverage_90%_high']:.1%})"
        for _, row in own.iterrows()
    )
    return (
        f"Intervals along the road, noise and its dependence on speed and gap learned from training drivers that were left out. The "
        f"90 % intervals hold {said}; in brackets 95 % intervals from drivers drawn anew."
    )
