"""A model fitted to records: free parameters with what is known of them, starts, steps, minima."""
