"""Shows the map on a page in the browser, live or from a recording."""
