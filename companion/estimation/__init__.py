"""Where the drone is and where the walls are.

    gyro ──────► heading filter ────────┐
    odometry ─► body displacement ──────┼─► pose ─► ranges seen as hits on wall lines
                   ▲                    │                 │            │
                   └── scale ◄──────────┴──── corrections ┘            ▼
                        ▲                                        flight record
                        └──── all set right every few seconds ◄─── smoother

`heading` keeps heading, gyro bias, gyro scale and the directions of walls; `wall_runs` finds
straight pieces of wall in each beam's stream of hits; `line_slam` keeps position, odometry scale
and the walls' offsets together. `smoother` solves for all of the `flight_record`, with
`association` to say which hit is on which wall, `squares` which walls are meant square, and
`factors` what that means; `doubt` looks where motion speaks against it; `in_flight` does so a piece
a tick. `estimator` is the order in which they are called.
"""
