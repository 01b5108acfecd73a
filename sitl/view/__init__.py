"""Shows the simulator as a web page: a true building beside the drone's map of it."""
