"""Other associations of a whole flight, searched for and compared by likelihood."""
