"""The simulator as a page in the browser: a true building beside what the drone maps of it."""
