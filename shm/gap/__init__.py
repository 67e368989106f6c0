"""Where model and measurement differ, which effect causes it, how far the gap shrinks."""
