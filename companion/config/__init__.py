"""Configuration: typed groups with units, defaults and bounds, from one TOML file."""
