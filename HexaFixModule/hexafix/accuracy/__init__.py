"""Layout rules, uniqueness and predicted pose error (Section 4)."""
