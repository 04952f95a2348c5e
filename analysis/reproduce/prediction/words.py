"""Sentences on prediction; every number in them is computed."""

from __future__ import annotations

import pandas as pd

from .seconds import OWN_PAST, RESIDUAL

ENTRY, ALONG, IN_LANE = "entry", "every 6 s", "every 6 s, in lane"


def describe(tables: dict[str, pd.DataFrame]) -> dict[str, object]:
    """Return the sentences by their name in the template.

    Parameters
    ----------
    tables : dict of str to pandas.DataFrame
        Tables by the name of their file.

    Returns
    -------
    dict of str to str or tuple of str
        Sentences.
    """
    numbers = tables["prediction_reasons"].set_index("what")["value"]
    share = tables["prediction_share"].set_index(["windows", "method"])
    seconds = tables["prediction_seconds"]
    return {
        "prediction_why": (
            _on_directions(numbers),
            _on_averaging(numbers),
            _on_the_code(tables["prediction_explained"]),
            _on_the_papers_gain(numbers, share),
        ),
        "prediction_limits": _on_limits(numbers, share, seconds),
        "prediction_for_whom_caption": on_groups(tables["prediction_distances"], tables["prediction_for_whom"]),
        "prediction_seconds_caption": caption(seconds),
        "prediction_coverage_text": _oncoverage_of(tables["prediction_coverage"]),
    }


def _on_directions(n: pd.Series) -> str:
    first, second = n["flattest direction, first"], n["flattest direction, second"]
    against = "against" if n["share of drivers in whom both grow together"] < 0.5 else "with"
    return (
        f"Ten seconds determine {n['directions determined']:.1f} of the five directions in the space of the "
        "parameters (mean over the test drivers; determined means a 95 % interval at most half as wide as the "
        f"range between the bounds); {n['share of directions not determined']:.0%} are not determined, and in "
        f"{n['share of drivers with a direction not determined']:.0%} of the drivers at least one. The flattest "
        f"direction is mostly {first} ({n['share of the flattest direction in the first']:.0%} of its square) and "
        f"{second} ({n['share of the flattest direction in the second']:.0%}), which change {against} each other: "
        "where speed hardly changes, one can replace the other."
    )


def _on_averaging(n: pd.Series) -> str:
    own, average, joint, pooled = (
        n[f"{name}: ADE (m)"]
        for name in (
            "neighbours' own parameters, on themselves",
            "neighbours' average, on themselves",
            "one set fitted to the neighbours, on themselves",
            "pooled, on the neighbours",
        )
    )
    versus = "more" if average > pooled else "less"
    on_driver, joint_on_driver, pooled_on_driver = (
        n[f"{name}: ADE (m)"]
        for name in (
            "neighbours' average, on the driver",
            "one set fitted to the neighbours, on the driver",
            "pooled, on the same drivers",
        )
    )
    return (
        "The average of the neighbours' parameters lies "
        f"{n['distance of the average from the neighbours (box)']:.2f} of the range between the bounds away from "
        f"each of them. A move of {n['longest move along the flattest direction (box)']:g} along the flattest "
        f"direction costs {100.0 * n['that move costs, median driver: ADE (m)']:.1f} cm of ADE (median driver). The "
        f"average costs the neighbours themselves {average - own:.2f} m: their ADE is {average:.2f} m with it, "
        f"{own:.2f} m with their own parameters, {joint:.2f} m with one set fitted to their rollouts together and "
        f"{pooled:.2f} m with the pooled set, so that averaging costs {versus} than knowing nothing. Averaging "
        f"leaves the flat valleys of the error. On the drivers to be predicted the average gives {on_driver:.2f} m, "
        f"the set fitted to the same neighbours {joint_on_driver:.2f} m, the pooled set {pooled_on_driver:.2f} m "
        f"({n['drivers whose neighbours were looked at']:.0f} test drivers)."
    )


def _on_the_code(explained: pd.DataFrame) -> str:
    r2 = explained.set_index("parameter")["r2"].dropna()
    if r2.empty:
        return "There are too few drivers to tell what the first second explains of their parameters."
    said = ", ".join(f"{max(value, 0.0):.0%} of {name}" for name, value in r2.sort_values(ascending=False).items())
    return (
        f"Of the variance of the fitted parameters the first second explains {said} in held-out drivers. Where in "
        "its flat valley a fit ends, no observation can predict."
    )


def _on_the_papers_gain(n: pd.Series, share: pd.DataFrame) -> str:
    free, drawn, pooled = (
        n[f"{name}: ADE (m)"]
        for name in (
            "averaged neighbours, free fits",
            "averaged neighbours, fits drawn to the population",
            "pooled, on the same windows",
        )
    )
    lanes = [
        f"{label} {share.loc[(kind, 'idm_prediction'), 'share']:.0%}"
        for kind, label in ((ALONG, "in all windows"), (IN_LANE, "in those without a lane change"))
        if (kind, "idm_prediction") in share.index
    ]
    verdict = "still no better than" if drawn >= pooled else "better than"
    return (
        "Where the paper's method would gain: with neighbours whose fits are drawn to the population, so that what "
        "a window does not determine stays near the population's mean, the same averaging has an ADE of "
        f"{drawn:.2f} m in place of {free:.2f} m, {verdict} the pooled {pooled:.2f} m. Its share of the way from "
        f"pooled to oracle is {' and '.join(lanes)}."
    )


def _on_limits(n: pd.Series, share: pd.DataFrame, seconds: pd.DataFrame) -> str:
    along = share.loc[ALONG]["share"]
    said = [
        f"On windows along the whole way predicted parameters close {along['idm_rollout']:.0%} of the distance from "
        f"pooled to oracle, a predicted residual beside the pooled set {along['idm_residual']:.0%} (with the observed "
        f"second smoothed with what follows, as recordings usually are, {along['idm_residual_ahead']:.0%}; what that "
        f"is better by is the future), a black box on the same second {along['black_box_first_second']:.0%}, one that "
        f"also knows the leader's future path {along['black_box_with_leaders_path']:.0%}."
    ]
    hindsight = "one set a driver in hindsight: share"
    if hindsight in n:
        said.append(
            f"One set for each driver, fitted in hindsight to all windows of its way, closes {n[hindsight]:.0%} "
            f"({n[hindsight + ', low']:.0%} to {n[hindsight + ', high']:.0%}, {n['drivers in hindsight']:.0f} "
            f"drivers): lasting parameters of a driver can hardly do better, and the other {1.0 - n[hindsight]:.0%} "
            "are variation of a driver between windows."
        )
    own, seen = (seconds[seconds["method"] == name] for name in (OWN_PAST, RESIDUAL))
    if len(own):
        longest = own.iloc[-1]
        off = " (below 0: worse than the pooled set)" if longest["share"] < 0.0 else ""
        said.append(
            f"Parameters fitted to a driver's own last {longest['observed_s']:g} s close "
            f"{longest['share']:.0%}{off}. A residual that is predicted from as long closes "
            f"{seen.iloc[-1]['share']:.0%}."
        )
    return " ".join(said)


def on_groups(distances: pd.DataFrame, gains: pd.DataFrame) -> str:
    """Say what prediction is worth, and for whom.

    Parameters
    ----------
    distances, gains : pandas.DataFrame
        As :mod:`analysis.reproduce.prediction.for_whom` returns them.

    Returns
    -------
    str
        A caption.
    """
    if distances.empty or gains.empty:
        return ""
    last = distances.iloc[-1]
    said = (
        f"After {last['seconds']:g} s the pooled driver is {last['idm_pooled']:.1f} m off, one with predicted "
        f"parameters {last['idm_rollout']:.1f} m, one with a residual {last['idm_residual']:.1f} m, the oracle "
        f"{last['idm_oracle']:.1f} m. "
    )
    rows = gains[gains["method"] == "idm_rollout"]
    most, least = rows.loc[rows["gain_m"].idxmax()], rows.loc[rows["gain_m"].idxmin()]
    unsure = rows[rows["gain_low_m"] <= 0.0]
    names = ", ".join(f"{by} {group}" for by, group in unsure[["by", "group"]].to_numpy())
    return (
        f"{said}Predicted parameters gain most for {most['by']} {most['group']} ({most['gain_m']:.2f} m of ADE), "
        f"least for {least['by']} {least['group']} ({least['gain_m']:.2f} m). "
        + (f"No gain is shown (95 % interval over drivers) for {names}." if names else "Every group gains.")
    )


def caption(seconds: pd.DataFrame) -> str:
    """Describe the table of observed seconds.

    Parameters
    ----------
    seconds : pandas.DataFrame
        The table.

    Returns
    -------
    str
        A caption.
    """
    seen = seconds[seconds["method"] == RESIDUAL].set_index("observed_s")
    if seen.empty:
        return "No driver is recorded for long enough to be observed for longer."
    first, last = seen.loc[1.0], seen.iloc[-1]
    return (
        "ADE of what follows (left) and share of the way from pooled to oracle (right, 95 % bootstrap intervals "
        f"over drivers) against the seconds observed; {last['number']:.0f} windows of {last['drivers']:.0f} test "
        f"drivers, the same at every point. After one second {first['ade_m']:.2f} m and {first['share']:.0%} "
        f"({first['share_low']:.0%} to {first['share_high']:.0%}), after {seen.index[-1]:g} s {last['ade_m']:.2f} m "
        f"and {last['share']:.0%} ({last['share_low']:.0%} to {last['share_high']:.0%}), a gain of "
        f"{100.0 * last['on_1s_m']:.1f} cm ({100.0 * last['on_1s_low_m']:.1f} to {100.0 * last['on_1s_high_m']:.1f}, "
        "paired)."
    )


def _oncoverage_of(coverage: pd.DataFrame) -> str:
    return (
        "Intervals along the road; the noise and its dependence on speed and gap are learned from held-out training "
        f"drivers. The 90 % intervals of predicted parameters contain {_contained(coverage, 'idm_rollout')}; those of "
        f"the residual {_contained(coverage, 'idm_residual')}; in brackets 95 % bootstrap intervals over drivers."
    )


def _contained(coverage: pd.DataFrame, method: str) -> str:
    return "; ".join(
        f"{row['coverage_90%']:.1%} at {row['seconds']:g} s ({row['coverage_90%_low']:.1%} to "
        f"{row['coverage_90%_high']:.1%})"
        for _, row in coverage[coverage["method"] == method].iterrows()
    )
