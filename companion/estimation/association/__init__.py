"""Which hit belongs to which wall, and which walls there are."""
