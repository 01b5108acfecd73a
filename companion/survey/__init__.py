"""One map from several flights."""
