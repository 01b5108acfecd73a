"""Maps logs of other robots: reads a log, estimates in one batch, checks the map, writes files.

log file ─► `reading` (one reader per format) ─► `record` ─► estimation ─► `mapper` ─► `files`
            `reading.sensors` (TOML beside it) ───┘
"""
