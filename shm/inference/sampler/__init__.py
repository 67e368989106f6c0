"""Draw from a posterior and integrate it: peaks, valleys, importance sampling, emcee."""
