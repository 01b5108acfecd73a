"""Accuracy of maps and estimates."""
