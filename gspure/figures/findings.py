"""What the numbers say, in plain sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite, isnan

from gspure.evaluation.outcomes import MESSAGE, REFERENCE, SCENE, Outcome

METHOD = "gspure"
PLANTED = "planted"

MINUS = "\N{MINUS SIGN}"


def findings(outcomes: Sequence[Outcome]) -> list[str]:
    """Return what happened to one model: what was taken away, what that did to message and scene, what else does so.

    Parameters
    ----------
    outcomes : sequence of Outcome
        All variants of one scheme and scene.

    """
    by_name = {o.variant: o for o in outcomes}
    method = by_name.get(METHOD)
    found = []
    if method is not None:
        found.append(_pruned(method))
        found.append(_damage(method))
    if any(isfinite(o.score) for o in outcomes):
        found.append(_ranking(outcomes))
    elif not any(MESSAGE in o.targets for o in outcomes):
        found.append(
            "No key to the message was given, so whether it survives was not measured: these numbers are the damage "
            "to the scene alone."
        )
    return [sentence for sentence in found if sentence]


def _pruned(o: Outcome) -> str:
    if isnan(o.pruned_share):
        return ""
    text = f"GSPure removed {o.pruned_share:.1%} of the Gaussians."
    if not isnan(o.precision):
        text += f" Of these, {o.precision:.1%} carried the message;"
        text += f" of all that carried it, {o.recall:.1%} were found."
    return text


def _damage(o: Outcome) -> str:
    changes = [text for target in (MESSAGE, SCENE) if (text := _change(o, target))]
    if not changes:
        return ""
    text = " and ".join(changes)
    score = f", a Score of {signed(o.score)} dB" if isfinite(o.score) else ""
    return f"{text[0].upper()}{text[1:]}{score}."


def _change(o: Outcome, target: str) -> str:
    if target not in o.targets:
        return ""
    after = o.targets[target].psnr
    if isfinite(o.psnr_drop(target)):
        before = o.reference[target].psnr
        return f"the {target} went from {before:.2f} to {after:.2f} dB PSNR ({signed(after - before)} dB)"
    return f"the {target} is at {decibels(after)} dB PSNR of the unattacked model's images"


def _ranking(outcomes: Sequence[Outcome]) -> str:
    ranked = sorted((o for o in outcomes if isfinite(o.score) and o.variant != REFERENCE), key=lambda o: -o.score)
    if len(ranked) < 2:
        return ""
    listed = ", ".join(f"{spoken(o.variant)} {signed(o.score)}" for o in ranked)
    return f"All attacks by their Score, best first: {listed}."


def limits(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield what the numbers of all models do not say, one sentence each."""
    if any(o.scheme == PLANTED for o in outcomes):
        yield (
            "A planted message is a demonstration with known truth. It shows that the measurement works, and says "
            "nothing about any published watermarking scheme."
        )
    silent = sorted({f"{o.scheme}/{o.scene}" for o in outcomes} - _with_message(outcomes))
    if silent:
        yield f"Whether a message survives was not measured for {', '.join(silent)}: that takes the owner's key."
    views = sorted({count for o in outcomes for count in o.views.values()})
    if views:
        span = str(views[0]) if len(views) == 1 else f"{views[0]} to {views[-1]}"
        yield f"Numbers are means over {span} views of each model and one seed of each attack, without error bars."
    yield (
        "PSNR and SSIM compare pixels. Whether a person, or a detector trained to, would still recognize the message "
        "was not tested."
    )
    yield (
        "Attacks that are not in the tables were not tested: among others training the model further, compressing it, "
        "and attacks made for one scheme."
    )


def _with_message(outcomes: Sequence[Outcome]) -> set[str]:
    return {f"{o.scheme}/{o.scene}" for o in outcomes if MESSAGE in o.targets}


def spoken(name: str) -> str:
    """Return a variant's name as people write it."""
    return {"gspure": "GSPure", "gaussian_noise": "Gaussian noise"}.get(name, name.replace("_", " "))


def decibels(value: float) -> str:
    """Return a PSNR with two decimals; ∞ for equal images, – where it is unknown."""
    return "–" if isnan(value) else "∞" if not isfinite(value) else f"{value:.2f}"


def signed(value: float) -> str:
    """Return a difference in dB with its sign; – where it is unknown or infinite."""
    return f"{value:+.2f}".replace("-", MINUS) if isfinite(value) else "–"


def percent(value: float) -> str:
    """Return a share; – where it is unknown."""
    return "–" if isnan(value) else f"{value:.1%}"
