"""The data behind pictures of point clouds: colours, ranks, legends."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gspure.figures import style
from gspure.figures.clouds import by_cluster, by_decision, by_rank, by_share, by_weight, ranks


def hexadecimal(text: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(text[1:]))


def test_clusters_have_colours_by_size_pale_ones_if_they_are_kept_and_noise_is_grey() -> None:
    sizes = [30 - i for i in range(len(style.CLUSTERS) + 3)]
    labels = np.concatenate([np.repeat(np.arange(len(sizes)), sizes), [-1, -1]]).astype(np.int32)
    relabelled = np.where(labels < 0, -1, len(sizes) - 1 - labels).astype(np.int32)  # the largest comes last by number
    for named in (labels, relabelled):
        pruned = labels % 3 == 0  # not the noise
        shown = by_cluster(named, pruned)
        for cluster, start in enumerate(np.cumsum([0, *sizes[:-1]])):
            base = hexadecimal(style.CLUSTERS[cluster % len(style.CLUSTERS)])
            lighter = shown.colours[start].astype(int) - base
            assert (lighter == 0).all() if pruned[start] else lighter.sum() > 0
        assert tuple(shown.colours[-1]) == hexadecimal(style.NOISE)
        text = " ".join(label for row in shown.legend for label, _ in row)
        fates = re.fullmatch("pruned:(.*)kept \\(pale\\):(.*)noise:.*", text).groups()
        assert all(f"{size / len(labels):.1%}" in fates[i % 3 > 0] for i, size in enumerate(sizes[:9]))


@settings(deadline=None)
@given(arrays(np.float32, 40, elements=st.floats(0, 9, width=16)), arrays(np.int32, 40, elements=st.integers(-1, 1)))
def test_the_rank_is_that_of_the_weight_that_decides(weights: np.ndarray, labels: np.ndarray) -> None:
    labels[:2] = 0, 1
    rank = ranks(labels, weights)
    deciding = weights.astype(np.float64)
    for cluster in (0, 1):
        deciding[labels == cluster] = weights[labels == cluster].mean(dtype=np.float64)
        assert np.ptp(rank[labels == cluster]) == 0
    for k in range(40):
        before, tied = np.sum(deciding < deciding[k]), np.sum(deciding == deciding[k])
        assert rank[k] == pytest.approx((before + (tied - 1) / 2) / 39)


@pytest.mark.parametrize(
    ("shown", "colours"),
    [
        (by_rank(np.array([0, 0.5, 1.0])), {0: "#440154", 2: "#fde724"}),  # viridis
        (by_weight(np.array([0.1, 0, 10], np.float32)), {0: "#440154", 1: style.NOISE, 2: "#fde724"}),
        (
            by_share(np.array([2, 0, 3, 0], np.float32), np.array([0, 5, 3, 0], np.float32)),
            {0: style.KEPT, 1: style.MESSAGE, 3: style.NOISE},
        ),
        (by_decision(np.array([True, False])), {0: style.PRUNED, 1: style.KEPT}),
    ],
    ids=["rank", "weight", "share", "decision"],
)
def test_ends_of_scales_unknown_values_and_decisions_have_their_colours(shown, colours) -> None:
    assert {row: tuple(shown.colours[row]) for row in colours} == {k: hexadecimal(c) for k, c in colours.items()}
    assert (shown.scale is None) == bool(shown.legend)
    if shown.scale is not None:
        assert tuple(shown.scale[0]) == hexadecimal(colours[0])
