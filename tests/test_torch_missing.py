"""Without torch all works but the bridge to it, which says what to install."""

import sys

import pytest

from gspure.errors import InputError


def test_the_bridge_without_torch_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    for name in ("pytorch", "torch_bridge"):
        monkeypatch.delitem(sys.modules, f"gspure.training.{name}", raising=False)
    with pytest.raises(InputError, match=r"^torch: package: expected PyTorch, .*pip install gspure\[torch\]"):
        import gspure.training.torch_bridge  # noqa: F401
