"""Tables of campaigns for the terminal."""
