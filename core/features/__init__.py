"""Local features: one extractor or matcher per file."""
