"""What all reports share: page, style, manifest."""
