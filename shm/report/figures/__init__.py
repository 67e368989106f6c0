"""The figures of all reports: each is drawn from one specification."""
