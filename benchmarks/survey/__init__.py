"""Surveys: changes between flights, and the cost of a joint map."""
