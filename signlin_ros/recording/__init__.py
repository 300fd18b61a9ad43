"""The equations of a model, recorded once with symbols: their trace, how effects are asked, signs made smooth."""
