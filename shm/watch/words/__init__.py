"""Say in words what the watch found."""
