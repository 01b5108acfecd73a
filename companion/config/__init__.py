"""The configuration: typed groups with unit, default and bounds, from one TOML file."""
