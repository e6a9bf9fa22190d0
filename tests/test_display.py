"""How models, cameras and results show themselves."""

import numpy as np
import pytest

from gspure.attacks import find_attack
from gspure.method.diagnosis import diagnose
from gspure.method.purify import Purification
from gspure.progress import Described
from tests.models import blobs, camera


def purification():
    labels, weights = np.array([0, 0, -1, -1], np.int32), np.array([4.0, 4.0, 4.0, 0.1], np.float32)
    diagnosis = diagnose(labels, weights, 4, 4, 0)
    return Purification(blobs(3), weights, labels, weights < 1, diagnosis)


@pytest.mark.parametrize(
    ("thing", "line"),
    [
        (lambda: blobs(1234, sh_degree=2), r"Gaussians\(rows: 1,234, SH degree: 2, .*extent of 90 %: .* x .* x "),
        (lambda: blobs(3)[:0], r"Gaussians\(rows: 0, "),
        (lambda: camera(40, 30, name="left"), r"Camera\(name: left, size: 40x30, focal length: 60 px, centre: "),
        (lambda: find_attack("random_pruning").apply(blobs(8), fraction=0.25), r"Attacked\(rows: 6, kept: 6 of 8\)"),
        (purification, r"Purification\(rows: 4, clusters: 1, pruned rows: 25.0%, "),
    ],
)
def test_a_result_is_one_line_in_a_terminal_and_a_table_in_a_notebook(thing, line):
    import re

    assert re.match(line, repr(thing()))
    assert "\n" not in repr(thing())
    assert thing()._repr_html_().count("<tr>") == len(thing().facts)


def test_names_cannot_bring_markup_into_a_notebook():
    class Named(Described):
        facts = {"name": "<script>"}  # noqa: RUF012

    assert "<script>" not in Named()._repr_html_()
