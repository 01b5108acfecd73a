"""Maps from logs recorded elsewhere: read, estimate in one batch, judge, write.

log file ─► `log` (a reader for each format) ─► `record` ─► estimation ─► `mapper` ─► `files`
            `sensors` (TOML beside it) ───────────┘
"""
