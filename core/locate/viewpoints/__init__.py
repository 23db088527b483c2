"""From where a scan is best looked at: its surface, candidate views, and what is seen from them."""
