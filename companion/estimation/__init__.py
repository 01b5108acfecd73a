"""Where the drone is and where the walls are.

    gyro ──────► heading filter ────────┐
    odometry ─► body displacement ──────┼─► pose ─► ranges seen as hits on wall lines
                   ▲                    │                 │
                   └── scale ◄──────────┴──── corrections ┘

`heading` keeps heading, gyro bias, gyro scale and the directions of walls; `wall_runs` finds
straight pieces of wall in each
beam's stream of hits; `line_slam` keeps position, odometry scale and the walls' offsets together;
`estimator` is the order in which they are called.
"""
