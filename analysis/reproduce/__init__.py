"""The paper's tables, figures and report."""
