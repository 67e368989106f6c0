"""The whole bridge on one page: each hanger in a line, and the pattern of their shifts."""
