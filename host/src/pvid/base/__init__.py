"""What every room needs: errors, the console, files written whole, text for sentences."""
