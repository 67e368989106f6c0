"""Our figures beside the thesis's: its frequency tables, and its choice among the model classes."""
