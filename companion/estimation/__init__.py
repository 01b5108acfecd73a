"""Where the drone is and where the walls are.

    gyro ──────► heading filter ────────┐
    odometry ─► body displacement ──────┼─► pose ─► ranges seen as hits on wall lines
                   ▲                    │                 │            │
                   └── scale ◄──────────┴──── corrections ┘            ▼
                        ▲                                        flight record
                        └──── all set right every few seconds ◄─── smoother

`filters` hold heading, gyro bias and scale, and the directions of walls (`heading_filter`);
straight pieces of wall in each beam's stream of hits (`wall_runs`); position, odometry scale and
the walls' offsets (`position_filter`). `smoothing` solves for the whole flight at once, a piece a
tick while it flies (`sliding_window`). `association` says which hit is on which wall. `hypotheses`
searches other associations where motion contradicts them. `estimator` is the order in which they
are called.
"""
