"""Who may see the page, and the server behind that check."""
