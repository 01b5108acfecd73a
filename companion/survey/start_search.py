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
from companion.estimation.smoothing.joint import moved_to
from companion.survey.evidence import Sight
from companion.survey.flights import Flown, Joint, LeftOut, Placed, worst_misfit
from companion.survey.unknown_start import (
    FOUND_SIGMA,
    Candidate,
    StartSearch,
    candidates,
    different_places,
    is_same,
    search_start,
    text,
)

WHOLE_SHARE = 0.85
"""A flight fits as a whole if this share of its walls agrees. Chosen: at the right start 0.9 or
more of a room agree."""
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
    """A flight with an unknown start."""

    flown: Flown
    refuted: list[Refuted] = field(default_factory=list)
    undone: int = 0
    reason: str = ""
    """Why it has no place in the map."""


class Placing:
    """Joint map that grows flight by flight."""

    def __init__(self, joint: Joint, unknown: Sequence[Flown]) -> None:
        """`joint`: the flights with known starts; `unknown`: those to be placed."""
        self.joint = joint
        self._known = len(joint.placed)
        self._waiting = [Waiting(each) for each in unknown]
        self._found: dict[str, Waiting] = {}
        flights = [*(each.flown for each in joint.placed), *unknown]
        self._sights = {each.name: each.sight() for each in flights}
        self._in_other: dict[tuple[str, str], list[Candidate]] = {}

    def run(self) -> tuple[Joint, list[LeftOut]]:
        """Place all flights that can be placed; returns the joint map and the others."""
        while self._place_next() or self._undo_worst():
            pass
        return self.joint, [LeftOut(each.flown.name, each.reason) for each in self._waiting]

    @property
    def _names(self) -> frozenset[str]:
        return frozenset(each.flown.name for each in self.joint.placed)

    def _place_next(self) -> bool:
        """Place the best-determined flight; False if the start of none is certain."""
        known = self.joint.sight()
        found: list[tuple[float, int, Array]] = []
        for number, each in enumerate(self._waiting):
            if each.undone >= MAX_UNDONE:
                continue
            search, each.reason = self._search(each, known, self._names)
            if search.found is not None and not each.reason:
                found.append((search.lead_m, -number, search.found.start))
        if not found:
            return False
        _, number, start = max(found, key=lambda each: each[:2])
        flight = self._waiting.pop(-number)
        self._found[flight.flown.name] = flight
        x = moved_to(flight.flown.x, start)
        here = Placed(flight.flown, x, start, FOUND_SIGMA, is_found=True)
        self.joint = Joint.of([*self.joint.placed, here])
        while (misfit := worst_misfit(self.joint, self._known)) is not None:
            self._undo(*misfit, is_refuted=True)
        return True

    def _undo_worst(self) -> bool:
        """Undo the start that the map of the other flights confirms least; False if all stay."""
        doubtful: list[tuple[float, int, str]] = []
        for number in range(self._known, len(self.joint.placed)):
            flight = self._found[self.joint.placed[number].flown.name]
            known, others = self.joint.sight(without=number), self._names - {flight.flown.name}
            search, reason = self._search(flight, known, others)
            start = self.joint.start(number)
            if search.found is not None and not reason:
                if is_same(search.found.start, start):
                    continue
                reason = f"another start fits better: {text(search.found.start)}"
            doubtful.append((search.score_m(start), number, reason))
        if not doubtful:
            return False
        _, number, reason = min(doubtful)
        self._undo(number, reason, is_refuted=False)
        return True

    def _undo(self, number: int, reason: str, *, is_refuted: bool) -> None:
        """Take a flight out of the joint map; it waits again."""
        placed = list(self.joint.placed)
        gone = placed.pop(number)
        flight = self._found.pop(gone.flown.name)
        flight.reason = reason
        flight.undone += 1
        if is_refuted:
            others = frozenset(each.flown.name for each in placed)
            flight.refuted.append(Refuted(gone.expected, others))
        self._waiting.append(flight)
        self.joint = Joint.of(placed)

    def _search(
        self, flight: Waiting, known: Sight, others: frozenset[str]
    ) -> tuple[StartSearch, str]:
        """Search the start of a flight in the map of others, without those that they refuted.

        The text says why none is certain; it is empty if one is.
        """
        name = flight.flown.name
        refuted = [each.start for each in flight.refuted if each.others <= others]
        search = search_start(self._sights[name], known, refuted)
        if search.found is None:
            return search, search.reason
        return search, self._seen_twice(name, search.found)

    def _seen_twice(self, name: str, found: Candidate) -> str:
        """Which other flight, placed or not, shows several places that the whole flight fits.

        Empty if there is none. A building may have two equal rooms, of which the map so far
        contains one.
        """
        sight = self._sights[name]
        for other, theirs in self._sights.items():
            if other == name:
                continue
            if (name, other) not in self._in_other:
                self._in_other[name, other] = candidates(sight, theirs)
            whole_m = max(found.score_m, WHOLE_SHARE * sight.length_m)
            places = different_places(self._in_other[name, other], sight, whole_m)
            if len(places) > 1:
                return f"it fits equally in {len(places)} places that {other} has seen"
        return ""
