"""How the offline interpreter learns: what people said, templates, a lexicon, and the fitting."""
