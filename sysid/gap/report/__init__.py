"""The results of a gap study as text, JSON and a page with plots."""
