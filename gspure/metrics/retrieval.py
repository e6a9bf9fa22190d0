"""Retrieval: whether an extraction is most similar to its message among candidates, regardless of brightness."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gspure.arrays import Float64
from gspure.errors import InputError
from gspure.images import levels, png_files, read_image
from gspure.metrics.comparison import ImagePair
from gspure.metrics.image_metrics import gradient_correlation
from gspure.metrics.statistics import detectability

CHANCE: Final = 0.05  # the message is retrieved if chance hits as many views with at most this probability
FALSE_POSITIVES: Final = 0.01  # rate of false candidates above the threshold of `Retrieval.tpr`


class Retrieval(NamedTuple):
    """How well one extraction retrieves its message, over the views on the camera path."""

    top1: float  # share of the views in which the message is more similar than every false candidate
    auc: float  # area under the ROC curve of true against false candidates, of all views together
    tpr: float  # share of the true candidates above the threshold that `FALSE_POSITIVES` of the false ones exceed
    views: int
    candidates: int  # number of candidates of a view, with the true one; the smallest over the views

    @property
    def succeeds(self) -> bool:
        """Whether random guesses would hit as many views, or more, with a probability of at most `CHANCE`."""
        from scipy.stats import binom

        hits = round(self.top1 * self.views)
        return bool(binom.sf(hits - 1, self.views, 1 / self.candidates) <= CHANCE)

    @property
    def decides(self) -> bool:
        """Whether there are enough views: a message that is nearest in all of them would be retrieved."""
        return self._replace(top1=1.0).succeeds


class Retrieved(NamedTuple):
    """One row of ``retrieval.csv``: one extraction of one variant of a model."""

    variant: str
    target: str
    retrieval: Retrieval


def retrieval(similarities: Sequence[Float64]) -> Retrieval:
    """Return how well a message is retrieved.

    `similarities` hold an array [N] per view: the similarity of the extraction to each candidate, the true one first.
    Views without a false candidate do not count. Raise `InputError` if no view has one.
    """
    views = [view for view in similarities if len(view) > 1]
    if not views:
        raise InputError("retrieval", "candidates", expected="pictures other than the message", found="none")
    true = np.array([view[0] for view in views])
    false = np.concatenate([view[1:] for view in views])
    threshold = np.quantile(false, 1 - FALSE_POSITIVES, method="higher")
    return Retrieval(
        top1=float(np.mean([view[0] > view[1:].max() for view in views])),
        auc=detectability(true, false).auc,
        tpr=float(np.mean(true > threshold)),
        views=len(views),
        candidates=min(map(len, views)),
    )


def false_candidates(pair: ImagePair, index: int, decoys: Sequence[Path]) -> list[Path]:
    """Return one picture of every folder of decoys: the view of the pair.

    In a folder without a view of this name, `index`, the number of the view, selects a picture. Raise `InputError` if a
    folder holds no picture.
    """
    candidates = []
    for folder in decoys:
        files = png_files(folder)
        same_view = [file for file in files if file.stem == pair.view]
        candidates.append(same_view[0] if same_view else files[index % len(files)])
    return candidates


def compare_candidates(pair: ImagePair, files: Sequence[Path]) -> Float64:
    """Return the gradient correlation [N] of an extraction with the candidates of its view, the true one first.

    `pair` holds photograph and extraction of the message. The false candidates are the photograph mirrored, upside down
    and turned by 180 degrees, and those of `files` that have its size. Equal candidates count once. Raise `InputError`
    if an image cannot be read, or the extraction has another size than the photograph.
    """
    truth = _levels(pair.reference)
    extraction = _levels(pair.image)
    candidates = [truth]
    for picture in (truth[:, ::-1], truth[::-1], truth[::-1, ::-1], *map(_levels, files)):
        if picture.shape == truth.shape and not any(np.array_equal(picture, candidate) for candidate in candidates):
            candidates.append(picture)
    return np.array([gradient_correlation(candidate, extraction) for candidate in candidates])


def retrieved(variant: str, pairs_of: Mapping[str, Sequence[ImagePair]], decoys: Sequence[Path]) -> Iterator[Retrieved]:
    """Yield the retrieval of each extraction of a variant; `pairs_of` holds extraction and photograph of its views."""
    for target, pairs in pairs_of.items():
        candidates = [false_candidates(pair, index, decoys) for index, pair in enumerate(pairs)]
        similarities = [compare_candidates(pair, files) for pair, files in zip(pairs, candidates, strict=True)]
        yield Retrieved(variant, target, retrieval(similarities))


def _levels(image: Path) -> Float64:
    """Return an image as whole numbers from 0 to 255: sums of these are exact, so equal correlations tie."""
    return levels(read_image(image)).astype(np.float64)
