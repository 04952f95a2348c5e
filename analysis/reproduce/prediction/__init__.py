"""Tables, figures and sentences on prediction."""
