"""The evaluation of a bag: what `mine-loc evaluate` does, for a program or a test of your own."""

from collections.abc import Callable
from pathlib import Path

from mine_loc_bringup.evaluation.bag import TRUTH, read_outputs, read_truth
from mine_loc_bringup.evaluation.evaluation import Evaluation, evaluate
from mine_loc_bringup.evaluation.measures import Comparing
from mine_loc_core.errors import ConfigurationError


def evaluate_bag(
    bag: Path,
    *,
    truth_bag: Path | None = None,
    truth: str | None = None,
    comparing: Comparing | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> Evaluation:
    """Everybody's measures in a bag, against the truth in it or in `truth_bag`, on topics like `truth`.

    `progress` hears which share is done. Raises ConfigurationError for what cannot be read, and for truth that was
    asked for and is not there.
    """
    outputs = read_outputs(bag, lambda share: progress(share / 2))
    source, topic = truth_bag or bag, truth or TRUTH
    truths = read_truth(source, topic, list(outputs.tracks), lambda share: progress((1 + share) / 2))
    if (truth or truth_bag) and not truths:
        raise ConfigurationError(f"{source}: no topic {topic}; allowed: a bag that has it")
    steps = {name: count for name in outputs.true_steps if (count := outputs.steps(name)) is not None}
    return evaluate(
        outputs.tracks,
        truths,
        steps,
        outputs.verdicts,
        outputs.span_ns,
        comparing or Comparing(),
        outputs.frame,
        outputs.counters,
    )
