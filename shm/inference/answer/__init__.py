"""Sample the problem of each model class and say what follows for the tension."""
