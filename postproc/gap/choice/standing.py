"""Where each effect stands once the rows have been heard: the one record of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from enum import StrEnum

from postproc.gap.choice.evidence import Evidence
from postproc.gap.fit import Subset
from postproc.records import dataclass


class Standing(StrEnum):
    """Where an effect stands in a diagnosis; the rows do not call for one that stands nowhere."""

    ADOPTED = "adopted"
    """In the model and named as a cause."""
    RESEMBLED = "resembled"
    """An alternative in the model: the gap behaves like it, and no known cause is to blame."""
    UNNAMED = "unnamed"
    """In the model without a name: too small to matter. Were it left out, something worse would be
    called in its place."""
    REJECTED = "rejected"
    """Not in the model, for a reason."""


@dataclass(frozen=True, slots=True)
class Choice:
    """What was chosen, and what speaks for it.

    standing: of blocks by key, those not listed are not called for; evidence: of blocks by key;
    probability: of effects by name; reasons: why effects are not adopted, by name.
    """

    standing: Mapping[str, Standing]
    evidence: Mapping[str, Evidence]
    probability: Mapping[str, float]
    reasons: Mapping[str, str]

    def having(self, *wanted: Standing) -> Subset:
        """Return the blocks of these standings, in their order."""
        return tuple(k for one in wanted for k, s in self.standing.items() if s is one)

    @property
    def adopted(self) -> Subset:
        """The blocks that are named, those first that explain most alone."""
        return tuple(sorted(self.having(Standing.ADOPTED), key=lambda k: -self.evidence[k].unique))

    @property
    def resembled(self) -> Subset:
        """The alternatives in the model."""
        return tuple(sorted(self.having(Standing.RESEMBLED)))

    @property
    def unnamed(self) -> Subset:
        """The blocks of the model that are too small to be named."""
        return self.having(Standing.UNNAMED)

    @property
    def model(self) -> Subset:
        """All blocks of the model."""
        return (*self.adopted, *self.resembled, *self.unnamed)

    def moved(self, keys: Iterable[str], to: Standing, reasons: Mapping[str, str]) -> Choice:
        """Return the choice with some blocks elsewhere, and the reasons by effect name."""
        moved = dict.fromkeys(keys, to)
        rest = {k: s for k, s in self.standing.items() if k not in moved}
        return replace(self, standing=rest | moved, reasons={**self.reasons, **reasons})
