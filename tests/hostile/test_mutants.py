"""The lists of tests that must notice mutants."""

import pytest

from tests.hostile.mutants import MODULES, ROOT


@pytest.mark.parametrize("module", MODULES)
def test_the_tests_of_a_module_exist(module: str) -> None:
    files = [name.split("::") for name in MODULES[module]]
    missing = [test for file, *test in files if f"def {''.join(test)}" not in (ROOT / "tests" / file).read_text()]
    assert missing == []
