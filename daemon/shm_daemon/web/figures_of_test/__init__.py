"""The interactive figures of one hammer test, as documents for plotly."""
