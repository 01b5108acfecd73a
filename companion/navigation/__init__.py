"""From one place to another through known free space.

`grid_planner` finds ways, `travel` gets to a place along one, `path_follower` flies it, `doorways`
are swept and passed squarely. `energy_reserve` keeps enough for the way home; `landing_site` is
where the drone lands if there is none.
"""
