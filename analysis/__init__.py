"""The study itself: one module a table or figure, the report and its page."""
