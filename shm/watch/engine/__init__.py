"""Model the change of a hanger: quantities, causes, readings, onset and how likely each is."""
