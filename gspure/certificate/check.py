"""A check of a plug-in: what it expects, and what is wrong."""

import re
from collections.abc import Callable
from typing import Final, NamedTuple

from gspure.attacks import NotApplicable

NAME: Final = re.compile("[a-z][a-z0-9_]*")
"""Names of attacks, schemes and detectors: words of commands, keys of configurations and names of folders."""


class Check(NamedTuple):
    """What was checked; the problem is empty if the plug-in passed."""

    name: str
    problem: str = ""
    is_rule: bool = True  # a plug-in that breaks it does not work; else, a finding about its mark

    @property
    def passed(self) -> bool:
        """Whether there is no problem."""
        return not self.problem


class RuleError(Exception):
    """A plug-in does not keep a rule."""


def check(name: str, test: Callable[[], object], *, is_rule: bool = True) -> Check:
    """Run a test, which raises an exception where the plug-in fails; an attack may lack something to act on."""
    try:
        test()
    except RuleError as broken:
        return Check(name, str(broken), is_rule)
    except NotApplicable as refusal:
        return Check(name, refusal.reason, is_rule=False)
    except Exception as error:  # noqa: BLE001 (a foreign module may raise anything)
        return Check(name, f"{type(error).__name__}: {error}", is_rule)
    return Check(name, is_rule=is_rule)


def name_check(name: str) -> Check:
    """Check the name of an attack, a scheme or a detector."""
    expected = "expected small letters, digits and _, with a letter first"
    return check("has a plain name", lambda: require(NAME.fullmatch(name) is not None, f"{name!r}: {expected}"))


def require(holds: bool, problem: str) -> None:  # noqa: FBT001
    """Raise `RuleError` with a problem unless a rule holds."""
    if not holds:
        raise RuleError(problem)
