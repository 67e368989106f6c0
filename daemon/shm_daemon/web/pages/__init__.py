"""The pages of the dashboard, one file a page: HTML for people, JSON beside it under `/api`."""
