"""What the columns of a run are made from: the parameters of its policy and the terms of its reward.

Both stores (SQLite for a run, Parquet for a sweep) make their columns of these names and keep the layout beside the
data, so that a run is read back without knowing its experiment.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Protocol

from ivl.forms import Form
from ivl.quantity import Quantity
from ivl.rewards import RewardChoice


class HasShape(Protocol):
    """A policy as a file says it."""

    @property
    def shape(self) -> Form:
        """Its form."""
        ...


class HasLayout(Protocol):
    """An experiment or a sweep."""

    @property
    def policy(self) -> HasShape:
        """The policy that is searched for."""
        ...

    @property
    def reward(self) -> RewardChoice:
        """The reward of its rollouts."""
        ...


@dataclass(frozen=True)
class Layout:
    """Names, units and meanings of what a run's columns hold.

    Attributes:
        policy: Parameters of the policy, in the order of every theta.
        terms: Terms of the reward, the return itself not among them.
    """

    policy: tuple[Quantity, ...]
    terms: tuple[Quantity, ...]

    def policy_columns(self, prefix: str = "") -> list[str]:
        """One column for each parameter of the policy: `mu` gives `mu_NAME`."""
        return [f"{prefix}_{parameter.name}" if prefix else parameter.name for parameter in self.policy]

    def term_columns(self, prefix: str = "reward") -> dict[str, str]:
        """Column of each term of the reward, by the term's name."""
        return {term.name: f"{prefix}_{term.name}" for term in self.terms}

    def to_dict(self) -> dict[str, list[dict[str, str]]]:
        """Plain data for a manifest."""
        return {role: [asdict(quantity) for quantity in quantities] for role, quantities in self.by_role()}

    @staticmethod
    def from_dict(data: Mapping[str, Iterable[Mapping[str, Any]]]) -> "Layout":
        """Inverse of `to_dict`."""
        return Layout(*(tuple(Quantity(**entry) for entry in data[role]) for role in ("policy", "terms")))

    def by_role(self) -> Iterator[tuple[str, tuple[Quantity, ...]]]:
        """The two groups of quantities with their names."""
        yield "policy", self.policy
        yield "terms", self.terms


EMPTY = Layout((), ())
"""The layout of what has neither a policy nor a reward (a policy map)."""


def layout_of(chosen: HasLayout) -> Layout:
    """The layout of an experiment's or a sweep's data; names and units of the policy are those of its form."""
    return Layout(
        policy=tuple(Quantity(p.name, p.unit, p.doc) for p in chosen.policy.shape.params),
        terms=chosen.reward.reward.terms,
    )
