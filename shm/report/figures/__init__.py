"""The figures of all reports: `every_figure` lists them, each is drawn from one specification."""
