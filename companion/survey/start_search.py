"""Places flights with unknown starts one by one, and undoes what later evidence contradicts.

    waiting ── one start fits ──► placed, all solved together
       ▲                                │
       └── another start fits as well or better, or its ranges contradict the map ──┘

The best-determined flight comes first. Each flight that was placed is compared again with the map
of the others once no more can be placed. So at the end each start is the only one that fits.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.core.arrays import Array
from companion.survey.evidence import Sight
from companion.survey.flights import Alone, Joint, LeftOut, Placed, worst_misfit
from companion.survey.unknown_start import FOUND_SIGMA, StartSearch, is_same, search_start

MAX_UNDONE = 3
"""After so many wrong starts a flight is left out for good. Chosen."""


@dataclass(frozen=True, slots=True)
class Refuted:
    """A start that did not fit in a joint solution."""

    start: Array
    """(3,)."""
    others: frozenset[str]
    """The flights of that solution. The start may be right if one of them was wrong."""


@dataclass(slots=True)
class Waiting:
    """A flight without a place in the map so far."""

    alone: Alone
    sight: Sight
    refuted: list[Refuted] = field(default_factory=list)
    undone: int = 0
    reason: str = ""
    """Why it has none."""

    def search(self, known: Sight, others: frozenset[str]) -> StartSearch:
        """Search its start in the map of others, without the starts that they refuted."""
        refuted = [each.start for each in self.refuted if each.others <= others]
        return search_start(self.sight, known, refuted)


class Placing:
    """Joint map that grows flight by flight."""

    def __init__(self, joint: Joint, unknown: Sequence[Alone]) -> None:
        """`joint`: the flights with known starts; `unknown`: those to be placed."""
        self.joint = joint
        self._known = len(joint.placed)
        self._waiting = [Waiting(each, each.sight()) for each in unknown]
        self._found: dict[str, Waiting] = {}

    def run(self) -> tuple[Joint, list[LeftOut]]:
        """Place all flights that can be placed; returns the joint map and the others."""
        while self._place_next() or self._undo_worst():
            pass
        return self.joint, [LeftOut(each.alone.name, each.reason) for each in self._waiting]

    @property
    def _names(self) -> frozenset[str]:
        return frozenset(each.alone.name for each in self.joint.placed)

    def _place_next(self) -> bool:
        """Place the best-determined flight; False if the start of none is certain."""
        known = self.joint.sight()
        found: list[tuple[float, int, Array]] = []
        for number, each in enumerate(self._waiting):
            if each.undone >= MAX_UNDONE:
                continue
            search = each.search(known, self._names)
            each.reason = search.reason
            if search.found is not None:
                found.append((search.lead_m, -number, search.found.start))
        if not found:
            return False
        _, number, start = max(found, key=lambda each: each[:2])
        flight = self._waiting.pop(-number)
        self._found[flight.alone.name] = flight
        self.joint = Joint.of([*self.joint.placed, Placed(flight.alone, start, FOUND_SIGMA)])
        self._undo_misfits()
        return True

    def _undo_misfits(self) -> None:
        """Undo starts whose ranges contradict the joint map."""
        while (misfit := worst_misfit(self.joint, self._known)) is not None:
            self._undo(*misfit, is_refuted=True)

    def _undo_worst(self) -> bool:
        """Undo the start that the map of the other flights confirms least; False if all stay."""
        doubtful: list[tuple[float, int, str]] = []
        for number in range(self._known, len(self.joint.placed)):
            placed = self.joint.placed[number]
            flight = self._found[placed.alone.name]
            others = self._names - {placed.alone.name}
            search = flight.search(self.joint.sight(without=number), others)
            start = self.joint.start(number)
            if search.found is None or not is_same(search.found.start, start):
                doubtful.append((search.score_m(start), number, search.reason))
        if not doubtful:
            return False
        _, number, reason = min(doubtful)
        self._undo(number, reason, is_refuted=False)
        return True

    def _undo(self, number: int, reason: str, *, is_refuted: bool) -> None:
        """Take a flight out of the joint map; it waits again."""
        placed = list(self.joint.placed)
        gone = placed.pop(number)
        flight = self._found.pop(gone.alone.name)
        flight.reason = reason
        flight.undone += 1
        if is_refuted:
            others = self._names - {gone.alone.name}
            flight.refuted.append(Refuted(gone.start, others))
        self._waiting.append(flight)
        self.joint = Joint.of(placed)
