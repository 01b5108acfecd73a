"""Maps from logs recorded elsewhere: read, estimate in one batch, judge, write.

log file ─► `reading` (a reader for each format) ─► `record` ─► estimation ─► `mapper` ─► `files`
            `reading.sensors` (TOML beside it) ─────────┘
"""
