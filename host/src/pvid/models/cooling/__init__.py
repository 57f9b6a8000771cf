"""A body that cools in air."""
