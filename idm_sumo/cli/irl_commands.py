"""``irl``: learn a reward, train agents, evaluate and vary them."""

from __future__ import annotations

import argparse
from typing import Any

from idm_sumo.cli import options as shared
from idm_sumo.cli import outputs
from idm_sumo.cli.console import note, progress_bar, say, study_module, text_table
from idm_sumo.runtime import limits
from idm_sumo.sumo.surrogate import SURROGATE

STEPS = 1_200_000
SEEDS = 3


LEARN = """\
learn the reward's weights from the training drivers (inverse optimal control)

reads   RECORDING ...
leaves  FILE, weights with standard errors, as JSON
next    idm-sumo irl train RECORDING -o agents"""
TRAIN = """\
learn the reward, then train agents on it by PPO, and clones beside them

Needs the extra `rl` (torch and stable-baselines3).

reads   RECORDING ...
leaves  DIR: reward, policies, learning curve, checkpoints
next    idm-sumo irl evaluate RECORDING --agents DIR -o scores.csv, or reproduce
        --agents DIR"""
EVALUATE = """\
drive the test drivers by trained agents and clones, and score them

reads   RECORDING ..., and the folder of `irl train`
leaves  FILE, one row a method and seed, as CSV
next    idm-sumo reproduce --agents DIR -o out sets them beside the other
        methods"""
VARIANTS = """\
train and score an agent on rewards learned in several ways

Shows which choice makes which difference: more demonstrations, the paper's five
features alone, negative weights, no penalty. Needs the extra `rl` (torch and
stable-baselines3).

reads   RECORDING ...
leaves  FILE, one row a variant, as CSV
next    idm-sumo irl train RECORDING -o agents, the first of them in full"""


def add(commands: Any) -> None:
    """Add the commands of this module.

    Parameters
    ----------
    commands : action of ``add_subparsers``
    """
    group = commands.add_parser(
        "irl", help="the paper's less constrained learner: learn a reward, train agents, evaluate them"
    )
    actions = group.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=type(group))
    parser = shared.command(actions, "learn", learn, LEARN, "idm-sumo irl learn RECORDING --quick -o reward.json")
    _source_arguments(parser)
    parser.add_argument(
        "--demonstrations",
        type=shared.whole(limits.COUNT),
        default=200,
        metavar="N",
        help="drivers to learn from (default 200)",
    )
    parser.add_argument(
        "--steps",
        type=shared.whole(limits.COUNT),
        default=50,
        metavar="FRAMES",
        help="of each demonstration (default 50, 5 s)",
    )
    shared.output_argument(parser, "FILE", "weights with standard errors, as JSON")
    outputs.declare(parser, "recording", endings=(".json",))

    parser = shared.command(actions, "train", train, TRAIN, "idm-sumo irl train RECORDING --quick -o agents")
    _source_arguments(parser)
    _training_arguments(parser)
    shared.output_argument(
        parser, "DIR", "reward, policies, learning curve; interrupted, the same command goes on from its checkpoints"
    )
    outputs.declare(parser, "recording", kept=True)

    parser = shared.command(
        actions, "evaluate", evaluate, EVALUATE, "idm-sumo irl evaluate RECORDING --quick --agents agents -o scores.csv"
    )
    _source_arguments(parser)
    parser.add_argument("--agents", type=shared.path, required=True, metavar="DIR", help="folder of `irl train`")
    shared.output_argument(parser, "FILE", "one row a method and seed, as CSV")
    outputs.declare(parser, "recording", endings=(".csv",))

    parser = shared.command(
        actions, "variants", variants, VARIANTS, "idm-sumo irl variants RECORDING --quick -o variants.csv"
    )
    _source_arguments(parser)
    _training_arguments(parser)
    shared.output_argument(parser, "FILE", "one row a variant, as CSV")
    outputs.declare(parser, "recording", endings=(".csv",))


def _training_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--agent-steps",
        type=shared.whole(limits.COUNT),
        default=STEPS,
        metavar="N",
        help=f"environment steps of each agent (default {STEPS:,})",
    )
    parser.add_argument(
        "--seeds",
        type=shared.whole(limits.COUNT),
        default=SEEDS,
        metavar="N",
        help=f"agents, with --seed and the next ones (default {SEEDS})",
    )
    shared.cluster_argument(parser, "train the agents")


def _source_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recording", type=shared.recording_name, metavar="RECORDING", nargs="+", help=shared.RECORDING_HELP
    )
    parser.add_argument(
        "--train", action="append", metavar="PERIOD", help="training period; may be repeated (default: the first)"
    )
    parser.add_argument(
        "--test", action="append", metavar="PERIOD", help="test period; may be repeated (default: all later ones)"
    )
    parser.add_argument(
        "--rollout-start",
        choices=("observed", "entry"),
        help="simulate from the last observed frame (default), or from entry",
    )
    parser.add_argument(
        "--quick", action="store_true", help="fewer drivers, a shorter built-in recording and a short training"
    )


def _settings(options: argparse.Namespace) -> Any:
    """Return the study's settings that the options ask for."""
    module = study_module("reproduce.settings")
    named = options.recording == [SURROGATE]
    overrides = {
        "recordings": None if named else tuple(options.recording),
        "train": options.train,
        "test": options.test,
        "rollout_start": options.rollout_start,
        "seed": options.seed,
        "agent_steps": getattr(options, "agent_steps", None),
        "agent_seeds": getattr(options, "seeds", None),
    }
    settings = module.load_settings(module.DEFAULT_RUN if named else None, overrides)
    return study_module("reproduce.run").quick(settings) if options.quick else settings


def learn(options: argparse.Namespace) -> None:
    """Learn the reward.

    Parameters
    ----------
    options : argparse.Namespace
    """
    module = study_module("reproduce.agents.study")
    with progress_bar() as report:
        table, words = module.learn(
            _settings(options),
            options.output,
            demonstrations=options.demonstrations,
            steps=options.steps,
            progress=report,
        )
    say(text_table(table), words, f"wrote {options.output}")


def train(options: argparse.Namespace) -> None:
    """Train agents.

    Parameters
    ----------
    options : argparse.Namespace
    """
    from idm_sumo.irl.learning import require_rl

    require_rl()
    module, cluster = study_module("reproduce.agents.study"), shared.cluster_of(options)
    with progress_bar() as report:
        table = module.train(_settings(options), options.output, cluster=cluster, progress=report)
    say(
        text_table(table),
        f"wrote {options.output}; evaluate it with `idm-sumo irl evaluate ... --agents {options.output}`",
    )


def evaluate(options: argparse.Namespace) -> None:
    """Score agents.

    Parameters
    ----------
    options : argparse.Namespace
    """
    module = study_module("reproduce.agents.study")
    with progress_bar() as report:
        table, missing = module.evaluate(_settings(options), options.agents, options.output, progress=report)
    if missing:
        note(missing)
    say(text_table(table), f"wrote {options.output}")


def variants(options: argparse.Namespace) -> None:
    """Train and score agents on rewards learned several ways.

    Parameters
    ----------
    options : argparse.Namespace
    """
    from idm_sumo.irl.learning import require_rl

    require_rl()
    module, cluster = study_module("reproduce.agents.variants"), shared.cluster_of(options)
    with progress_bar() as report:
        table = module.variants(_settings(options), options.output, cluster=cluster, progress=report)
    shown = table[["variant", "ade_m", "fde_m", "collisions", "contacts", "off_road", "weight_speed"]]
    say(text_table(shown), f"wrote {options.output}")
