"""Predict a hanger's tests by each hypothesis: parameters, errors, likelihood and posterior."""
