"""What measurements show of a model without a fit: scores, what its equations lack, where it fails."""
