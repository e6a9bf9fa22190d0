"""The data behind pictures of point clouds: colours, ranks, legends."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gspure.figures import style
from gspure.figures.clouds import Cloud, cluster_cloud, kept_cloud, rank_cloud, ranks, share_cloud

RNG = np.random.default_rng(3)
BALL = RNG.normal(size=(400, 3)).astype(np.float32)


def colour(cloud: Cloud, row: int) -> tuple[int, ...]:
    return tuple(int(c) for c in cloud.colours[row])


def hexadecimal(text: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(text[1:]))


def test_clusters_have_colours_by_size_pale_ones_if_they_are_kept_and_noise_is_grey() -> None:
    sizes = [30 - i for i in range(len(style.CLUSTERS) + 3)]
    labels = np.concatenate([np.repeat(np.arange(len(sizes)), sizes), [-1, -1]]).astype(np.int32)
    relabelled = np.where(labels < 0, -1, len(sizes) - 1 - labels).astype(np.int32)  # the largest comes last by number
    for named in (labels, relabelled):
        pruned = labels % 3 == 0  # not the noise
        cloud = cluster_cloud(np.zeros((len(labels), 3), np.float32), named, pruned)
        for cluster, start in enumerate(np.cumsum([0, *sizes[:-1]])):
            base = hexadecimal(style.CLUSTERS[cluster % len(style.CLUSTERS)])
            lighter = np.array(colour(cloud, start)) - base
            assert (lighter == 0).all() if pruned[start] else lighter.sum() > 0
        assert colour(cloud, -1) == hexadecimal(style.NOISE)
        text = " ".join(label for row in cloud.legend for label, _ in row)
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


def test_low_and_high_ranks_have_the_ends_of_the_scale() -> None:
    cloud = rank_cloud(BALL[:3], ranks(np.full(3, -1, np.int32), np.array([5, 0, 1], np.float32)))
    assert colour(cloud, 1) == (68, 1, 84)  # viridis
    assert colour(cloud, 0) == (253, 231, 36)
    assert cloud.scale
    assert not cloud.legend


def test_the_share_of_the_message_goes_from_the_colour_of_the_scene_to_that_of_the_message() -> None:
    cloud = share_cloud(BALL[:4], np.array([2, 0, 3, 0], np.float32), np.array([0, 5, 3, 0], np.float32))
    assert [colour(cloud, i) for i in (0, 1, 3)] == [hexadecimal(c) for c in (style.KEPT, style.MESSAGE, style.NOISE)]
    middle = np.mean([hexadecimal(style.KEPT), hexadecimal(style.MESSAGE)], axis=0)
    np.testing.assert_allclose(cloud.colours[2], middle, atol=1)
    assert cloud.scale
    assert (colour(cloud, 0), colour(cloud, 1)) == tuple(map(tuple, cloud.scale.colours[[0, -1]].tolist()))


def test_pruned_gaussians_have_another_colour() -> None:
    cloud = kept_cloud(BALL[:4], np.array([True, False, False, False]))
    assert [colour(cloud, k) for k in range(4)] == [hexadecimal(c) for c in (style.PRUNED, *[style.KEPT] * 3)]
    assert [label.rpartition(": ")[2] for label, _ in cloud.legend[0]] == ["75.0%", "25.0%"]
