"""Steps of the pose that are believed."""

from companion.estimation.steps import TIMES, Steps


def test_a_step_within_what_the_pose_may_be_off_is_made() -> None:
    assert Steps().believes(step_m=0.6, sigma_m=0.3)


def test_a_step_of_centimetres_is_made_however_sure_the_pose_is() -> None:
    assert Steps().believes(step_m=0.1, sigma_m=0.001)


def test_a_wild_step_is_made_when_it_has_come_out_again_and_again() -> None:
    steps = Steps()
    believed = [steps.believes(step_m=0.6, sigma_m=0.05) for _ in range(TIMES)]
    assert believed == [False] * (TIMES - 1) + [True]


def test_wild_steps_that_come_and_go_are_never_made() -> None:
    steps = Steps()
    for _ in range(TIMES):
        assert not steps.believes(step_m=0.6, sigma_m=0.05)
        assert steps.believes(step_m=0.02, sigma_m=0.05)
