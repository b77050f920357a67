"""Measurements that anyone can repeat: what the README's figures come from."""
