"""What any program needs: errors, progress, files, threads, memory."""
