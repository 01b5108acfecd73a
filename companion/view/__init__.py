"""Looking on: what the drone has mapped, live or from a recording, as a page in the browser."""
