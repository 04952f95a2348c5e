"""Files, pictures and page of a diagnosis."""
