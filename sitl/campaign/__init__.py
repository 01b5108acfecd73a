"""Campaigns: thousands of flights that differ in chosen settings.

file (definition.py) ─► flights (flight.py) ─► sitl.bench.engine ─► rows (results.py)
                                                                     ├─► tables (summary.py)
                                                                     ├─► plots (plots.py)
                                                                     └─► differences (compare.py)
"""
