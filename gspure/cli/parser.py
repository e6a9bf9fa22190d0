"""The parser of commands: their kinds of arguments, and refusals in one line."""

import argparse
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from gspure.errors import printable
from gspure.settings import Range

Arguments = argparse.Namespace
Metavar = str | tuple[str, ...]
_DEFAULT = " (default: %(default)s)"


class Parser(argparse.ArgumentParser):
    """A parser that refuses a wrong command line in one line, and empty texts: an empty path is the current folder."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.described: Callable[[str], str] | None = None  # what `--help` prints after an attack
        self.register("type", None, partial(filled, str))
        self.register("type", Path, partial(filled, Path))

    def reads(self, name: str, metavar: str, meaning: str, **settings: Any) -> None:
        """Add a file or folder to read; an option without a default is required unless `required` is false."""
        if name.startswith("-") and "default" not in settings:
            settings = {"required": True, **settings}
        settings = {"type": Path, "metavar": metavar, **settings}
        self.add_argument(name, help=_with_default(meaning, settings.get("default")), **settings)

    def writes(self, name: str, metavar: str, meaning: str, **settings: Any) -> None:
        """Add a folder (DIR) or file to write; the metavar of a file names its suffixes, such as CSV or PNG|SVG."""
        suffixes = () if metavar == "DIR" else tuple(f".{suffix.lower()}" for suffix in metavar.split("|"))
        self.reads(name, metavar, meaning, type=partial(_output, suffixes), **settings)
        self.set_defaults(outputs=[*(self.get_default("outputs") or []), name.lstrip("-").replace("-", "_")])

    def text(self, name: str, metavar: str, meaning: str, default: str | None = None, **settings: Any) -> None:
        """Add a text."""
        help_text = _with_default(meaning, default)
        self.add_argument(name, metavar=metavar, help=help_text, default=default, **settings)

    def number(
        self, name: str, metavar: Metavar, meaning: str, limits: Range, default: float | None = None, **settings: Any
    ) -> None:
        """Add a number within `limits`, perhaps to a `group` of options; `name` may hold a short name, too."""
        if limits.most <= 1000:  # larger bounds are far above what is useful
            meaning += f"; {limits}"
        if default is not None:
            meaning += _DEFAULT
        settings |= {"metavar": metavar, "help": meaning, "default": default, "type": partial(_number, limits)}
        group = settings.pop("group", self)
        group.add_argument(*name.split(), **settings)

    def choice(self, name: str, choices: Iterable[str], meaning: str, default: str | None = None) -> None:
        """Add one of some texts."""
        self.add_argument(name, choices=tuple(choices), help=_with_default(meaning, default), default=default)

    def flag(self, *names_and_meaning: str) -> None:
        """Add a switch: its names, and its meaning."""
        *names, meaning = names_and_meaning
        self.add_argument(*names, action="store_true", help=meaning)

    def pairs(self, name: str, metavar: str, meaning: str) -> None:
        """Add a repeatable option ``NAME=VALUE``: a list of pairs."""
        self.add_argument(name, action="append", type=_pair, metavar=metavar, help=f"{meaning}; repeatable", default=[])

    def parse_args(self, words: Sequence[str]) -> Arguments:  # type: ignore[override]
        """Parse all words; a command with `passed_on` passes on those after ``--``.

        A misspelt option is refused first, because argparse would report the intended one as missing instead.
        """
        wants_help = not {"-h", "--help"}.isdisjoint(words[1:])
        if self.described and wants_help and not words[0].startswith("-"):
            print(self.described(words[0]), end="")
            self.exit()
        end = len(words)
        if "--" in words and "passed_on" in self._defaults:
            end = words.index("--")
        known = self._option_string_actions
        for word in words[:end]:
            option = word.partition("=")[0]
            if option.startswith("--") and not any(name.startswith(option) for name in known):
                self.error(f"no option {option}{suggestion(option, known.keys() - {'--help'})}")
        parsed = super().parse_intermixed_args(words[:end])  # PAIR of `embed` may follow options
        if end < len(words):
            parsed.passed_on = [*words[end + 1 :]]
        return parsed

    def error(self, message: str) -> NoReturn:
        """Print the reason, and exit with status 2."""
        self.exit(2, f"{self.prog}: {printable(message)}; see `{self.prog} --help`\n")


def _with_default(meaning: str, default: object) -> str:
    return meaning + _DEFAULT if default else meaning


def filled(kind: Callable[[str], Any], text: str) -> Any:
    """Return a text as another type, or refuse an empty one."""
    if not text.strip():
        raise argparse.ArgumentTypeError("expected a value, found an empty text")
    return kind(text)


def _output(suffixes: tuple[str, ...], text: str) -> Path:
    if suffixes and not text.lower().endswith(suffixes):
        raise argparse.ArgumentTypeError(f"expected a name that ends with {' or '.join(suffixes)}, found {text!r}")
    return Path(filled(Path, text))


def _number(limits: Range, text: str) -> float:
    value = limits.parse(text)
    if value is None:
        raise argparse.ArgumentTypeError(f"expected {limits.expected}, found {text!r}")
    return value


def _pair(text: str) -> tuple[str, str]:
    name, _, value = text.partition("=")
    if not name or not value:
        raise argparse.ArgumentTypeError(f"expected NAME=VALUE, found {text!r}")
    return name, value


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return the end of a refusal of `word`: the most similar known one, if any is similar."""
    near = get_close_matches(word, known, 1)
    return f", did you mean {near[0]}?" if near else ""
