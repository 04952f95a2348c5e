"""Errors, progress, files, threads and memory: needed everywhere."""
