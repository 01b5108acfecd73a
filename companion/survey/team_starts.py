"""Where the flights of a team's drones began: on the pads that their configurations name."""

from collections.abc import Sequence

import numpy as np

from companion.config.team import PadConfig, TeamConfig
from companion.core.arrays import Array
from companion.core.errors import SurveyError
from companion.earlier import SURVEY_PAD
from companion.recording.reader import Recording
from companion.team.pads import pad_sigma, relative_pad


def check_same_team(recordings: Sequence[Recording]) -> None:
    """Refuse recordings whose pads are not those of one team.

    Raises:
        SurveyError: two teams differ in their name or their pads.
    """
    of_teams = [recording for recording in recordings if recording.config.team.name]
    for recording in of_teams[1:]:
        team, first = recording.config.team, of_teams[0].config.team
        if (team.name, team.pads) != (first.name, first.pads):
            raise SurveyError(
                f"{recording.path}: team.name or team.pads differs from that of "
                f"{of_teams[0].path}; correct it, or merge the flights of one team"
            )


def pad_of(team: TeamConfig) -> PadConfig:
    """The pad of a drone. One that flies alone begins on the first pad."""
    return team.pads[team.drone - 1] if team.name else PadConfig()


def team_starts(recordings: Sequence[Recording]) -> dict[str, Array]:
    """Starts (3,) of a team's flights after the first, in its frame, by the recording's name."""
    first = pad_of(recordings[0].config.team)
    return {
        each.path.name: relative_pad(first, pad_of(each.config.team))
        for each in recordings[1:]
        if each.config.team.name
    }


def team_sigma(recordings: Sequence[Recording]) -> Array:
    """(3,): largest sigmas of the starts from the pads; zero without a team."""
    teams = [recording.config.team for recording in recordings]
    sigmas: Array = np.max([SURVEY_PAD, *(pad_sigma(each) for each in teams if each.name)], axis=0)
    return sigmas
