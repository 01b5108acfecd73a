"""Navigation from one place to another through known free space.

`grid_planner` computes shortest paths. `travel` is the state machine that flies to a goal.
`path_follower` computes the setpoints along a path. `doorways` finds doorways on a path, sweeps
their jambs and passes them at a right angle. `energy_reserve` decides when to return.
`landing_site` selects a landing site when there is no path home.
"""
