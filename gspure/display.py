"""How models, cameras and results show themselves in a terminal and in a notebook."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from html import escape


class Described(ABC):
    """An object with a few facts: one line in a terminal, a table in a notebook."""

    @property
    @abstractmethod
    def facts(self) -> Mapping[str, str]:
        """The facts to show, by name."""

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}: {fact}' for name, fact in self.facts.items())})"

    def _repr_html_(self) -> str:
        rows = (f"<tr><th>{escape(name)}</th><td>{escape(fact)}</td></tr>" for name, fact in self.facts.items())
        return f"<table><caption>{type(self).__name__}</caption>{''.join(rows)}</table>"
