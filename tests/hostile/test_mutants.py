"""The lists of tests that must notice mutants."""

import pytest
from mutants import MODULES, ROOT


@pytest.mark.parametrize("module", MODULES)
def test_the_tests_of_a_module_exist(module: str) -> None:
    files = [name.split("::") for name in MODULES[module]]
    missing = [test for file, *test in files if f"def {''.join(test)}" not in (ROOT / "tests" / file).read_text()]
    assert missing == []


def test_all_modules_of_plans_and_jobs_are_listed() -> None:
    files = [*ROOT.glob("gspure/evaluation/*.py"), *ROOT.glob("gspure/workflow/*.py")]
    tested_by_running = {"__init__", "running"}
    modules = {f"gspure.{file.parent.name}.{file.stem}" for file in files if file.stem not in tested_by_running}
    assert modules <= MODULES.keys()
