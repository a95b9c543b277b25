"""`play`, `segments`, `view` and templates: nominal motion as tables, scenes and pages."""
