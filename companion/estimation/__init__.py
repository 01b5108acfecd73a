"""Estimates the drone's pose and the walls from gyro, odometry and range readings.

    gyro ──────► heading filter ────────┐
    odometry ─► body displacement ──────┼─► pose ─► hits on wall lines
                   ▲                    │                 │            │
                   └── scale ◄──────────┴──── corrections ┘            ▼
                        ▲                                        flight record
                        └──── all corrected every few seconds ◄──── smoother

- `filters`: heading, gyro bias and scale, and wall directions (`heading_filter`); straight runs in
  each beam's stream of hits (`wall_runs`); position, odometry scale and wall offsets
  (`position_filter`).
- `smoothing`: solves the whole flight at once. In flight it runs in pieces, one a tick
  (`sliding_window`).
- `association`: assigns hits to walls.
- `hypotheses`: searches other associations where odometry or the gyro contradict the solution.
- `estimator`: calls these parts in order.
"""
