"""With the owner's key: the rows that hold a message, and what they show."""

from collections.abc import Iterator

import numpy as np
import pytest

from gspure.evaluation.revealing import Revealed, reveal
from gspure.method.settings import MethodSettings
from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.opencl.device import choose_device
from tests import evaluation_cases as cases

LOST = 5  # row of the message whose centre is no number


@pytest.fixture(scope="module")
def revealed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Revealed]:
    """What the key of Lantern reveals of a model with a row that cannot be drawn."""
    with cases.project(tmp_path_factory.mktemp("project")):
        rows = cases.public_rows()
        x = rows.table["x"].copy()
        x[LOST] = np.nan
        cases.LanternModel(rows.with_columns({"x": x})).write(cases.PUBLIC)
        yield reveal(cases.PUBLIC, cases.owner(), MethodSettings(), choose_device())


def message_rows() -> list[int]:
    return [row for row in range(cases.ROWS)[cases.MESSAGE_ROWS] if row != LOST]


def test_only_rows_of_the_message_have_a_hidden_weight(revealed: Revealed) -> None:
    weighted = np.flatnonzero(revealed.hidden)
    assert len(revealed.hidden) == cases.ROWS
    assert {*weighted} <= {*message_rows()}
    assert weighted.max() >= cases.SHOWN[ADAPTIVE]


def test_the_gaussians_of_the_message_name_rows_of_the_whole_model(revealed: Revealed) -> None:
    gaussians, rows = revealed.message(cases.views()[1])
    assert rows.tolist() == message_rows()
    shown, _ = cases.lantern_key().revealed(cases.LanternModel(cases.public_rows()[rows]), cases.ORACLE)
    assert gaussians.table.tobytes() == shown.table.tobytes()


def test_the_first_extraction_of_a_model_is_shown_in_a_training_view(revealed: Revealed) -> None:
    public = cases.LanternModel(cases.public_rows())
    image = cases.lantern_key().message(public, MESSAGE)
    np.testing.assert_array_equal(revealed.extracted(public), image(cases.views()[4]))
