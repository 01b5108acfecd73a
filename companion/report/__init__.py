"""A flight told to somebody who was not there."""
