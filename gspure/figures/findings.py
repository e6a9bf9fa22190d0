"""What the numbers say, in plain sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite, isnan
from typing import Final

from gspure.evaluation.contest import METHOD
from gspure.evaluation.outcomes import MESSAGE, REFERENCE, SCENE, Outcome
from gspure.figures.wording import MINUS, plural

PLANTED: Final = "planted"

_NAMED: Final = 8
"""How many attacks a sentence names."""

SPOKEN: Final = {
    "message_oracle": "message (oracle)",
    "splats_in_splats": "Splats in Splats",
    "gs_hider": "GS-Hider",
    "secure_gs": "SecureGS",
}

_WORDS: Final = {"gspure": "GSPure", "gof": "GOF", "gaussian": "Gaussian"}

DIAGNOSIS_TERMS: Final = {
    "gaussians": "rows (Gaussians, or anchors)",
    "clusters": "clusters found",
    "largest_share": "rows in the largest cluster",
    "noise_share": "rows in no cluster (noise)",
    "pruned_share": "pruned",
    "pruned_as_cluster": "pruned as part of a cluster",
    "pruned_as_noise": "pruned one by one, as noise",
    "pruned_weight_share": "share of all weight that was pruned",
    "plain_share": "pruned by the same threshold without clustering",
    "changed_share": "share of the decision that clustering changed",
    "hidden_low_share": "share of the message's own weight that lies on rows of low public weight",
}
"""Fields of `gspure.clustering.Diagnosis` and of `gspure hidden` in the order of telling, and what they mean."""


def findings(outcomes: Sequence[Outcome]) -> list[str]:
    """Return what happened to one model, a sentence or two for each question that the numbers answer.

    Parameters
    ----------
    outcomes : sequence of Outcome
        All variants of one scheme and scene.

    """
    method = next((o for o in outcomes if o.variant == METHOD), None)
    found = [_measured(outcomes)]
    if method is not None:
        found += [_pruned(method), _damage(method), *_other_extractions(method)]
    found += [_ranking(outcomes), _floor(outcomes)]
    if not any(MESSAGE in o.targets for o in outcomes):
        found.append(
            "No key to the message was given, so whether it survives was not measured: these numbers are the damage "
            "to the scene alone."
        )
    return [sentence for sentence in found if sentence]


def _measured(outcomes: Sequence[Outcome]) -> str:
    attacks = sum(o.variant != REFERENCE and not o.is_control and not o.failure for o in outcomes)
    views = max((count for o in outcomes for count in o.views.values()), default=0)
    what = "scene and hidden message" if any(MESSAGE in o.targets for o in outcomes) else "scene"
    against = "photographs" if all(o.against_truth for o in outcomes) else "what the unattacked model shows"
    return (
        f"{plural(attacks, 'attack')} on this model, judged by {plural(views, 'view')} of its {what}, compared with "
        f"{against}."
    )


def _pruned(o: Outcome) -> str:
    if isnan(o.pruned_share):
        return ""
    text = f"GSPure removed {o.pruned_share:.1%} of the model."
    if not isnan(o.precision):
        text += f" {o.precision:.1%} of these carried the message, and {o.recall:.1%} of all its carriers were removed."
    return text


def _damage(o: Outcome) -> str:
    if isfinite(o.score):
        return (
            f"It took the message from {_from_to(o, MESSAGE)}, and the scene from {_from_to(o, SCENE)}: a Score of "
            f"{signed(o.score)}."
        )
    if SCENE in o.targets and isfinite(o.targets[SCENE].psnr):
        return f"After it, views of the scene have a PSNR of {o.targets[SCENE].psnr:.2f} dB against those before."
    return ""


def _other_extractions(o: Outcome) -> Iterator[str]:
    for target in o.messages:
        if target != MESSAGE and isfinite(o.score_of(target)):
            yield f"Of the {spoken(target)} it left {_from_to(o, target)}."


def _floor(outcomes: Sequence[Outcome]) -> str:
    shown = [(o.targets[MESSAGE].psnr, spoken(o.variant)) for o in outcomes if o.is_control and MESSAGE in o.targets]
    if not shown:
        return ""
    listed = ", ".join(f"{name} {decibels(psnr)}" for psnr, name in sorted(shown, reverse=True))
    return f"Where there is no message, or no right key, the message's PSNR is, in dB: {listed}."


def _from_to(o: Outcome, target: str) -> str:
    before, after = o.reference[target].psnr, o.targets[target].psnr
    return f"{before:.2f} to {after:.2f} dB ({signed(after - before)})"


def _ranking(outcomes: Sequence[Outcome]) -> str:
    ranked = sorted((o for o in outcomes if isfinite(o.score) and o.variant != REFERENCE), key=lambda o: -o.score)
    if len(ranked) < 2:
        return ""
    listed = ", ".join(f"{spoken(o.variant)} {signed(o.score)}" for o in ranked[:_NAMED])
    others = f", and {len(ranked) - _NAMED} more" if len(ranked) > _NAMED else ""
    return f"By Score, what the message lost less what the scene lost, the attacks rank: {listed}{others}."


def limits(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield what the numbers of all models do not say, one sentence each."""
    if any(o.scheme == PLANTED for o in outcomes):
        yield (
            "A planted message is a demonstration with known truth. It shows that the measurement works, and says "
            "nothing about any published watermarking scheme."
        )
    silent = sorted({f"{o.scheme}/{o.asset}" for o in outcomes} - _with_message(outcomes))
    if silent:
        yield f"Whether a message survives was not measured for {', '.join(silent)}: that takes the owner's key."
    relative = sorted({f"{o.scheme}/{o.asset}" for o in outcomes if not o.against_truth})
    if relative:
        yield (
            f"PSNR and SSIM of {', '.join(relative)} are against the unattacked model's own views: they say how far an "
            "attack changed these, not how close they were to photographs to begin with."
        )
    views = sorted({count for o in outcomes for count in o.views.values()})
    if views:
        span = str(views[0]) if len(views) == 1 else f"{views[0]} to {views[-1]}"
        yield f"Numbers of one model are means over {span} views and one seed of each attack, without error bars."
    yield (
        "PSNR and SSIM compare pixels. Whether a person, or a detector trained to, would still recognize the message "
        "was not tested."
    )
    yield (
        "Attacks that are not in the tables were not tested: among others training the model further, compressing it, "
        "and attacks made for one scheme."
    )


def _with_message(outcomes: Sequence[Outcome]) -> set[str]:
    return {f"{o.scheme}/{o.asset}" for o in outcomes if MESSAGE in o.targets}


def spoken(name: str) -> str:
    """Return the name of a scheme, a variant or a target as people write it."""
    return SPOKEN.get(name) or " ".join(_WORDS.get(word, word) for word in name.split("_"))


def decibels(value: float) -> str:
    """Return a PSNR with two decimals; ∞ for equal images, – where it is unknown."""
    return "–" if isnan(value) else "∞" if not isfinite(value) else f"{value:.2f}"


def signed(value: float) -> str:
    """Return a difference in dB with its sign; – where it is unknown or infinite."""
    return f"{value:+.2f}".replace("-", MINUS) if isfinite(value) else "–"


def percent(value: float) -> str:
    """Return a share; – where it is unknown."""
    return "–" if isnan(value) else f"{value:.1%}"
